"""What a supervisor says of a device that does not open, as soon as the first try has failed."""

import time

PATIENCE_S = 20.0


def failure_of(supervisor):
    supervisor.start()
    until_s = time.monotonic() + PATIENCE_S
    while (failure := supervisor.failure) is None:
        assert not supervisor.alive
        assert time.monotonic() < until_s
        time.sleep(0.01)
    supervisor.close()
    return failure
