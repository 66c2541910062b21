"""Quality of service as rmw_zenoh writes it into a liveliness token.

`<reliability>:<durability>:<history>,<depth>:<deadline>:<lifespan>:<liveliness>`, each number that of the enum in
rmw/types.h, and nothing where it is rmw_zenoh's default (reliable, volatile, keep last 42).
"""

import re
from dataclasses import dataclass

DEFAULT_DEPTH = 42
_RELIABLE, _BEST_EFFORT = "1", "2"
_TRANSIENT_LOCAL, _VOLATILE = "1", "2"
_LAST, _ALL = "1", "2"
_PATTERN = re.compile(r"([0-9]?):([0-9]?):([0-9]?),([0-9]{0,9})(:[0-9,]*){3}")


@dataclass(frozen=True, slots=True)
class RosQos:
    """What matters of it here. `depth` is None where all is kept; `latched` is ROS's transient local."""

    reliable: bool = True
    latched: bool = False
    depth: int | None = 10

    def __str__(self) -> str:
        """In words."""
        kept = "all" if self.depth is None else f"last {self.depth}"
        return f"{'reliable' if self.reliable else 'best effort'}{', transient local' if self.latched else ''}, {kept}"

    def encode(self) -> str:
        """As it stands in a token."""
        reliability = "" if self.reliable else _BEST_EFFORT
        durability = _TRANSIENT_LOCAL if self.latched else ""
        history = _ALL if self.depth is None else ""
        depth = "" if self.depth in (None, DEFAULT_DEPTH) else str(self.depth)
        return f"{reliability}:{durability}:{history},{depth}:,:,:,,"


def parse_qos(text: str) -> RosQos | None:
    """Read what stands in a token; None for what is none."""
    match = _PATTERN.fullmatch(text)
    if match is None:
        return None
    reliability, durability, history, depth = match.groups()[:4]
    kept = int(depth) if depth else DEFAULT_DEPTH
    return RosQos(reliability != _BEST_EFFORT, durability == _TRANSIENT_LOCAL, None if history == _ALL else kept)
