"""One module per verb of `lira`, each with `add_arguments(parser)` and `run(args) -> exit status`.

The module's docstring is the verb's help: first what it does, then examples. Heavy imports belong inside `run`.
"""
