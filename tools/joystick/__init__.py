"""The joystick bridge: a person's hand on the robot, without a screen.

`codes`, `axes`, `mapping`, `families`, `deadman`, `requests`, `freeze`, `rumble`, `pad_detect`, `nodes` are pure;
`event_device`, `pad` and `finder` touch the device, `known_pads` a file, `client` the bus, `bridge` is the loop.
"""
