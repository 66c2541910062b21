"""The points in a stream of the RPLIDAR: pure functions over bytes, one per answer type, vectorised.

Each takes everything that was not consumed yet and returns the points in it, how many bytes it is done with, and how
many of them were lost. What is left has to be handed in again with what comes next. The newest packet always waits for
its successor: a capsule's points lie between its angle and the next one's, and a standard node is only believed beside
a plausible neighbour.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lira.robot.rplidar.protocol import Answer

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]

NODE_SIZE = 5
CAPSULE_SIZE = 84
HEAD_SIZE = 4  # of a capsule: check nibbles and the start angle
EXPRESS_POINTS = 32
DENSE_POINTS = 40

# So many nodes in a row have to look right before a place in the stream is taken for the start of a node.
SURE_NODES = 3
# The angle may jitter back a little, and goes on by no more than this between two nodes (15 Hz at 2000 samples/s: 2.7).
BACK_DEG = 2.0
AHEAD_DEG = 10.0
# A capsule that spans so many times what capsules have spanned of late, and a bit, has lost its successor.
STRETCH, SLACK_DEG = 1.5, 0.5
# What a point spans at most: a head at 20 Hz, 508 us a sample.
POINT_DEG = 360.0 * 20.0 * 508e-6


NOTHING: Floats = np.empty(0)


@dataclass(frozen=True, slots=True)
class Points:
    """A piece of a stream. `theta_rad`: clockwise from the unit's front, [0, 2 pi); `distance_m`: 0 is invalid.

    `consumed` bytes are done with, `lost` of them made no sense. `waiting` points have come that are not among these.
    `span_deg`: from each capsule to the next one, also of those that were refused.
    """

    theta_rad: Floats
    distance_m: Floats
    consumed: int = 0
    lost: int = 0
    waiting: int = 0
    span_deg: Floats = field(default_factory=lambda: NOTHING)

    def __len__(self) -> int:
        return len(self.theta_rad)


class Parser(Protocol):
    """Reads one answer type. `usual_deg` is what capsules have spanned of late, if that is known."""

    def __call__(self, buffer: bytes, usual_deg: float = math.inf) -> Points:
        """Return the points at the start of the buffer."""


def parse_standard(buffer: bytes, usual_deg: float = math.inf) -> Points:  # noqa: ARG001 - a node has its own angle
    """Read nodes of 5 bytes: quality, S and its inverse; check bit, angle / 64 deg; distance / 4 mm."""
    data = np.frombuffer(buffer, np.uint8)
    pieces: list[tuple[Floats, Floats]] = []
    at = lost = 0
    while True:
        skip = _find_nodes(data[at:])
        lost += skip
        at += skip
        nodes = data[at : at + (len(data) - at) // NODE_SIZE * NODE_SIZE].reshape(-1, NODE_SIZE)
        if len(nodes) < SURE_NODES:
            break
        bad = np.flatnonzero(~_node_checks(nodes))
        run = nodes[: bad[0]] if len(bad) else nodes
        theta, distance = _read_nodes(run)
        believed = _believable(theta)
        # The newest node waits for its neighbour, unless it will not get one.
        done = len(run) if len(bad) else len(run) - 1
        keep = believed[:done]
        pieces.append((np.radians(theta[:done][keep]), distance[:done][keep]))
        lost += NODE_SIZE * int(np.count_nonzero(~keep))
        at += NODE_SIZE * done
        if not len(bad):
            break
    theta_rad, distance_m = _join(pieces)
    return Points(theta_rad, distance_m, at, lost, waiting=(len(data) - at) // NODE_SIZE)


def _node_checks(nodes: Bytes) -> NDArray[np.bool_]:
    """Which nodes [n, 5] have their check bits right and an angle below a full turn."""
    opposite = ((nodes[:, 0] ^ nodes[:, 0] >> 1) & 1) == 1
    angle = nodes[:, 2] < 360 * 64 * 2 >> 8
    ok: NDArray[np.bool_] = opposite & ((nodes[:, 1] & 1) == 1) & angle
    return ok


def _find_nodes(data: Bytes) -> int:
    """Count the bytes before the first place where nodes look right; too few of them to judge is no reason to go on."""
    room = len(data) - SURE_NODES * NODE_SIZE + 1
    if room <= 0 or _sure(data[: SURE_NODES * NODE_SIZE].reshape(-1, NODE_SIZE)):
        return 0
    places = np.lib.stride_tricks.sliding_window_view(data, NODE_SIZE)
    right = _node_checks(places)
    for at in np.flatnonzero(right[:room] & right[NODE_SIZE:][:room] & right[2 * NODE_SIZE :][:room]):
        if _sure(places[at::NODE_SIZE][:SURE_NODES]):
            return int(at)
    return room


def _sure(nodes: Bytes) -> bool:
    """Whether a few places [n, 5] in a row look like nodes that follow each other."""
    return bool(_node_checks(nodes).all() and _believable(_read_nodes(nodes)[0]).all())


def _read_nodes(nodes: Bytes) -> tuple[Floats, Floats]:
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


def parse_express(buffer: bytes, usual_deg: float = math.inf) -> Points:
    """Read capsules of 16 cabins: two distances / 4 mm with 2 bits of an angle's correction, and the rest of both."""
    return _parse_capsules(buffer, usual_deg, EXPRESS_POINTS, _express_points)


def parse_dense(buffer: bytes, usual_deg: float = math.inf) -> Points:
    """Read capsules of 40 distances in mm, evenly spread between two start angles."""
    return _parse_capsules(buffer, usual_deg, DENSE_POINTS, _dense_points)


def _express_points(bodies: Bytes) -> tuple[Floats, Floats]:
    cabins = bodies.reshape(len(bodies), 16, 5).astype(np.uint16)
    words = np.stack([cabins[..., 0] | cabins[..., 1] << 8, cabins[..., 2] | cabins[..., 3] << 8], axis=-1)
    low = np.stack([cabins[..., 4] & 0x0F, cabins[..., 4] >> 4], axis=-1)
    corrections_deg = (low | (words & 0x03) << 4) / 8.0
    shape = len(bodies), EXPRESS_POINTS
    return (words & 0xFFFC).reshape(shape) / 4000.0, corrections_deg.reshape(shape)


def _dense_points(bodies: Bytes) -> tuple[Floats, Floats]:
    words = np.ascontiguousarray(bodies).view("<u2")
    return words / 1000.0, np.zeros((1, 1))


def _parse_capsules(
    buffer: bytes, usual_deg: float, count: int, read: Callable[[Bytes], tuple[Floats, Floats]]
) -> Points:
    data = np.frombuffer(buffer, np.uint8)
    pieces: list[tuple[Floats, Floats]] = []
    spans: list[Floats] = []
    at = lost = 0
    while True:
        capsules = data[at : at + (len(data) - at) // CAPSULE_SIZE * CAPSULE_SIZE].reshape(-1, CAPSULE_SIZE)
        if not len(capsules):
            break
        bad = np.flatnonzero(~_capsule_checks(capsules))
        run = capsules[: bad[0]] if len(bad) else capsules
        span_deg, follows = _capsule_spans(run, usual_deg, count)
        spans.append(span_deg)
        pieces.append(_capsule_points(run, span_deg, follows, read))
        lost += int(np.count_nonzero(~follows)) * CAPSULE_SIZE
        if not len(bad):
            at += CAPSULE_SIZE * (len(run) - 1)  # the newest waits for the next one's angle
            break
        # The capsule before the bad one has no successor; the one after it may begin anywhere.
        skip = CAPSULE_SIZE * len(run) + _find_capsule(data[at + CAPSULE_SIZE * len(run) :])
        lost += skip - CAPSULE_SIZE * max(len(run) - 1, 0)
        at += skip
    theta_rad, distance_m = _join(pieces)
    waiting = (len(data) - at) // CAPSULE_SIZE * count
    return Points(theta_rad, distance_m, at, lost, waiting, np.concatenate([NOTHING, *spans]))


def _capsule_checks(capsules: Bytes) -> NDArray[np.bool_]:
    """Which capsules [n, 84] have their check nibbles and their sum right."""
    nibbles = ((capsules[:, 0] >> 4) == 0xA) & ((capsules[:, 1] >> 4) == 0x5)
    given = (capsules[:, 0] & 0x0F) | capsules[:, 1] << 4
    ok: NDArray[np.bool_] = nibbles & (given == np.bitwise_xor.reduce(capsules[:, 2:], axis=1))
    return ok


def _find_capsule(data: Bytes) -> int:
    """Count the bytes, at least one, before the first place where a capsule may begin, complete or not."""
    nibbles = (data[1:-1] >> 4 == 0xA) & (data[2:] >> 4 == 0x5)
    for at in np.flatnonzero(nibbles) + 1:
        capsule = data[at : at + CAPSULE_SIZE]
        if len(capsule) < CAPSULE_SIZE or _capsule_checks(capsule[None])[0]:
            return int(at)
    # The last byte may be the first of a capsule.
    return max(len(data) - 1, 1)


def _capsule_spans(run: Bytes, usual_deg: float, count: int) -> tuple[Floats, NDArray[np.bool_]]:
    """Degrees from each capsule [n] of a run to the next one [n - 1], and whether that one continues it."""
    words = run[:, 2].astype(np.uint16) | run[:, 3].astype(np.uint16) << 8
    span_deg: Floats = np.diff((words & 0x7FFF) / 64.0) % 360.0
    begins = words[1:] >> 15 == 1  # a stream, or the unit's own count of angles, which it does in mid stream, too
    if len(span_deg) and not math.isfinite(usual_deg):
        usual_deg = float(np.quantile(span_deg, 0.5, method="lower"))
    limit_deg = min(POINT_DEG * count, STRETCH * usual_deg) + SLACK_DEG
    return span_deg, ~begins & (span_deg <= limit_deg)


def _capsule_points(
    run: Bytes, span_deg: Floats, follows: NDArray[np.bool_], read: Callable[[Bytes], tuple[Floats, Floats]]
) -> tuple[Floats, Floats]:
    """Points of those capsules of a run, without its last, that the next one follows."""
    if not follows.any():
        return NOTHING, NOTHING
    kept = run[:-1][follows]
    start_deg = ((kept[:, 2].astype(np.uint16) | kept[:, 3].astype(np.uint16) << 8) & 0x7FFF) / 64.0
    distance_m, correction_deg = read(kept[:, HEAD_SIZE:])
    count = distance_m.shape[1]
    share = np.arange(count) / count
    theta_deg = start_deg[:, None] + span_deg[follows][:, None] * share - correction_deg
    return np.radians(theta_deg % 360.0).reshape(-1), distance_m.reshape(-1)


def _join(pieces: list[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    if len(pieces) == 1:
        return pieces[0]
    theta = [theta for theta, _ in pieces]
    distance = [distance for _, distance in pieces]
    return np.concatenate([NOTHING, *theta]), np.concatenate([NOTHING, *distance])


PARSERS: dict[Answer, Parser] = {
    Answer.DENSE: parse_dense,
    Answer.EXPRESS: parse_express,
    Answer.STANDARD: parse_standard,
}
"""What we understand, best first."""
