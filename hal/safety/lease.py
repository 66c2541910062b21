"""The lease: one commander at a time. Pure; every time is on the robot's clock.

A commander's token is its name, which an access list vouches for where there are keys, with the epoch of its session,
which it keeps to itself. Its first command takes a free lease and every further one renews it. It ends when the
commander says so, or `ttl_s` after its last command. Whoever lost it by silence to another does not get it back in the
same session: what is still on its way from there is old.
"""

import math
from collections import deque

from lira.hal.messages.motion import Token

REMEMBERED = 64  # sessions that lost the lease


class Lease:
    """Who may command."""

    def __init__(self, ttl_s: float) -> None:
        self._ttl_s = ttl_s
        self._holder: Token | None = None
        self._until_s = -math.inf
        self._lost: deque[Token] = deque(maxlen=REMEMBERED)

    def objection(self, token: Token, now_s: float) -> str | None:
        """Say why this commander may not command now; None if it may."""
        if token in self._lost:
            return "old epoch"
        if self._holder not in (None, token) and now_s < self._until_s:
            return "another commander"
        return None

    def renew(self, token: Token, now_s: float) -> None:
        """Give it to a commander to which there is no objection."""
        if self._holder is not None and self._holder != token:
            self._lost.append(self._holder)
        self._holder = token
        self._until_s = now_s + self._ttl_s

    def release(self) -> None:
        """Let anybody have it."""
        self._holder = None
