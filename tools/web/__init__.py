"""The page in the browser: the robot as a person sees it, and a stick for the thumb.

`lira web` is a process of its own. `frame` says what is shown, `seat` who drives and whether the page still lives,
`access` who gets in; `server` brings them to the browser, and the page itself is plain JavaScript in `static/`.
A page drives through the same bridge as a gamepad (`tools/joystick`): it is a pad that comes over the network.
"""
