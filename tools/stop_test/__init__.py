"""The stop test: break something while a robot drives, and measure when it stands.

`rows` is the table of what is broken, `setups` what it is tried on, `acts` how. `parts` are the processes under test,
started by `parts.launch`, with tools/launch/link_fault.py as the link between them; `parts.sender` marks what they
send, `journal` is what they write down. `matrix` tries one row after the other on a `testbed`, `verdict` says what a
trial's journal shows. `mutants` break the product on purpose, and `cull` sees whether the rows notice.
"""
