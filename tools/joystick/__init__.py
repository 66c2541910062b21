"""The joystick bridge: a person's hand on the robot, without a screen.

`codes`, `mapping`, `stick`, `hand`, `requests`, `freeze`, `rumble`, `learn`, `nodes` are pure; `pad` touches the
device, `memory` a file, `client` the bus, `bridge` is the loop.
"""
