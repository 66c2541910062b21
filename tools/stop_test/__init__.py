"""The stop test: break something while a robot drives, and measure when it stands.

`robot` and `driver` are the processes under test, `relay` (tools/relay.py) the link between them, `faults` the table of
what is broken, `matrix` one trial after the other, `verdict` what a trial's journal says.
"""
