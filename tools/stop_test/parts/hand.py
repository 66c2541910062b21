"""A person's hand under test: the bridge of `lira joystick`, with a pad that is moved by word instead of by thumbs.

Control messages: `go` grips and pushes the stick as far as it goes; `leave` lets go.

python -m lira.tools.stop_test.parts.hand NAME HOST:PORT CONTROL_PORT
"""

import sys
import threading
import time

from lira.hal.bus.bus import Bus
from lira.hal.bus.topics import INFO
from lira.tools.bench.takeover import PipePad
from lira.tools.joystick.bridge import Bridge
from lira.tools.joystick.client import TeleopClient
from lira.tools.joystick.known_pads import PadMemory
from lira.tools.joystick.pads.codes import AXES, BUTTONS, EV_ABS, EV_KEY
from lira.tools.stop_test.control import listen

READY = "a hand by word"
ANSWER_S = 5.0
REST_S = 0.3  # with the hand on and the stick at rest, which arms the robot
CENTRE, FORWARD = 128, 0


def main(name: str, endpoint: str, control_port: int) -> None:
    """Drive by word."""
    pad = PipePad()
    mapping = pad.mapping
    axis = AXES[mapping.forward.axis]

    def hold(button: str, down: int) -> tuple[int, int, int]:
        return EV_KEY, BUTTONS[button], down

    def hear(word: str) -> None:
        if word == "go":
            pad.send((EV_ABS, axis, CENTRE), hold(mapping.dead_man, 1), hold(mapping.turbo, 1))
            time.sleep(REST_S)
            pad.send((EV_ABS, axis, FORWARD))
        elif word == "leave":
            pad.send((EV_ABS, axis, CENTRE), hold(mapping.dead_man, 0))

    bus = Bus(name, connect=endpoint)
    bus.ask(INFO)
    watch = Bus(name, connect=endpoint, watch=True)
    client = TeleopClient(bus, watch, ANSWER_S)
    bridge = Bridge(client, lambda: pad, PadMemory(None))
    listen(control_port, hear)
    print(READY, flush=True)
    try:
        bridge.run(threading.Event())
    finally:
        for session in (bus, watch):
            session.close()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
