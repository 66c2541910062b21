"""`lira doctor`: what is wrong on this machine and with its devices, each with its remedy.

`finding` is what a check says, `checks` the table of all of them; `machine`, `access`, `network`, `sensors` and `pads`
hold the checks; `page` prints.
"""
