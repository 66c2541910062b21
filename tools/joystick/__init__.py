"""The joystick bridge: a person's hand on the robot, without a screen.

`codes`, `mapping`, `stick`, `hand`, `freeze`, `rumble`, `learn`, `nodes` are pure; `pad` touches the device,
`wheel` the bus, `bridge` is the loop.
"""
