"""The standard stream: nodes of five bytes, which three bits and their neighbours show to be nodes. Vectorised."""

import numpy as np
from numpy.typing import NDArray

from lira.robot.rplidar.points import CORRECTION_RAD, NOTHING, Bytes, Floats, Points

SIZE = 5
# So many nodes in a row have to look right before a place in the stream is taken for the start of a node.
SURE_NODES = 3
# From one node to the next the angle goes on by a sample (3.7 degrees at most) and the step of the correction (8), or
# back by that step: nodes without a distance are not corrected, and stand ahead of their neighbours.
BACK_DEG, AHEAD_DEG = 8.5, 12.0


class NodeDecoder:
    """Reads nodes: quality, S and its inverse; check bit, angle / 64 deg; distance / 4 mm.

    The newest waits for its neighbour.
    """

    def __init__(self, sample_s: float = 0.0) -> None:  # noqa: ARG002 - each node has its own angle
        self.size = SIZE
        self.back_rad = CORRECTION_RAD
        self._buffer = b""

    @property
    def left(self) -> int:
        """Bytes that wait for more."""
        return len(self._buffer)

    def feed(self, data: bytes) -> Points:
        """Take what came, and return the points that it completes."""
        self._buffer += data
        stream = np.frombuffer(self._buffer, np.uint8)
        pieces: list[tuple[Floats, Floats]] = [(NOTHING, NOTHING)]
        at = lost = 0
        while True:
            skip = _find_nodes(stream[at:])
            lost += skip
            at += skip
            nodes = stream[at : at + (len(stream) - at) // SIZE * SIZE].reshape(-1, SIZE)
            if len(nodes) < SURE_NODES:
                break
            bad = np.flatnonzero(~_checks(nodes))
            run = nodes[: bad[0]] if len(bad) else nodes
            theta_deg, distance_m = _read(run)
            # The newest node waits for its neighbour, unless it will not get one.
            done = len(run) if len(bad) else len(run) - 1
            keep = _believable(theta_deg)[:done]
            pieces.append((np.radians(theta_deg[:done][keep]), distance_m[:done][keep]))
            lost += SIZE * int(np.count_nonzero(~keep))
            at += SIZE * done
            if not len(bad):
                break
        self._buffer = self._buffer[at:]
        theta_rad, distance_m = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        return Points(theta_rad, distance_m, lost, len(self._buffer) // SIZE)


def _checks(nodes: Bytes) -> NDArray[np.bool_]:
    """Which nodes [n, 5] have their check bits right and an angle below a full turn."""
    opposite = ((nodes[:, 0] ^ nodes[:, 0] >> 1) & 1) == 1
    angle = nodes[:, 2] < 360 * 64 * 2 >> 8
    ok: NDArray[np.bool_] = opposite & ((nodes[:, 1] & 1) == 1) & angle
    return ok


def _find_nodes(data: Bytes) -> int:
    """Count the bytes before the first place where nodes look right; too few of them to judge is no reason to go on."""
    room = len(data) - SURE_NODES * SIZE + 1
    if room <= 0 or _sure(data[: SURE_NODES * SIZE].reshape(-1, SIZE)):
        return 0
    places = np.lib.stride_tricks.sliding_window_view(data, SIZE)
    right = _checks(places)
    for at in np.flatnonzero(right[:room] & right[SIZE:][:room] & right[2 * SIZE :][:room]):
        if _sure(places[at::SIZE][:SURE_NODES]):
            return int(at)
    return room


def _sure(nodes: Bytes) -> bool:
    """Whether a few places [n, 5] in a row look like nodes that follow each other."""
    return bool(_checks(nodes).all() and _believable(_read(nodes)[0]).all())


def _read(nodes: Bytes) -> tuple[Floats, Floats]:
    """Angles in degrees and distances in metres of nodes [n, 5]."""
    words = nodes[:, 1:].astype(np.uint16)
    angle = (words[:, 0] | words[:, 1] << 8) >> 1
    distance = words[:, 2] | words[:, 3] << 8
    return angle / 64.0, distance / 4000.0


def _believable(theta_deg: Floats) -> NDArray[np.bool_]:
    """Which angles [n] follow from the one before or lead to the one after."""
    step = (np.diff(theta_deg) + BACK_DEG) % 360.0
    smooth = step <= BACK_DEG + AHEAD_DEG
    believed: NDArray[np.bool_] = np.append(smooth, False) | np.append(False, smooth)
    return believed
