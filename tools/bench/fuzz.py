"""Garbage to every decoder that faces the bus: each input ends in a value or in the decoder's own error, and soon.

Half of the inputs are valid messages with bytes changed, cut out or put in, half are random. Seeded, so that what fails
can be repeated.
"""

import random
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import msgspec
import numpy as np

from lira.fusion.modalities.image import gray_image
from lira.hal.bus.attachment import Attachment, parse_attachment
from lira.hal.bus.services import REALTIME, EstopState, Info, info_from_json, reset_time
from lira.hal.errors import LiraError
from lira.hal.messages import CompressedImage, Episode, Image
from lira.hal.messages.compression import compress
from lira.hal.messages.ros.codec import CODECS, decode, encode
from lira.hal.profile import load_profile, profile_from_json
from lira.sim_backend.catalogue import load_world
from lira.sim_backend.world import World
from lira.tools.bench import Row
from lira.tools.bench.parts.samples import of_kind

INPUTS = 100_000
SEED = 1
LONGEST = 300
SLOW_S = 0.5  # an input that takes longer could hold up whoever decodes it


@dataclass(frozen=True, slots=True)
class Target:
    """A decoder, the errors it may raise, and valid inputs to start from."""

    name: str
    decode: Callable[[bytes], object]
    errors: tuple[type[Exception], ...]
    valid: tuple[bytes, ...]


def targets() -> list[Target]:
    """Everything that takes bytes off the bus."""
    profile = load_profile("rosbot2")
    json_errors = (msgspec.MsgspecError, ValueError)
    estop = msgspec.json.encode(EstopState("armed", {"late": 3}))
    world = msgspec.json.encode(load_world("corridor"))
    found = [
        Target(kind.__name__, partial(decode, kind), (LiraError,), tuple(map(encode, of_kind(kind)))) for kind in CODECS
    ]
    picture = Image(1.0, np.full((48, 64, 3), 90, np.uint8))
    pictures = tuple(compress(picture, encoding).data for encoding in ("jpeg", "png"))
    return [
        *found,
        Target("attachment", parse_attachment, (LiraError,), (Attachment(1, 2, 3, 4).to_bytes(),)),
        Target("profile", profile_from_json, (LiraError,), (profile.to_json(),)),
        Target("info", info_from_json, (LiraError,), (Info(profile, REALTIME, 1).to_json(),)),
        Target("episode", partial(msgspec.json.decode, type=Episode), json_errors, (msgspec.json.encode(Episode()),)),
        Target("estop", partial(msgspec.json.decode, type=EstopState), json_errors, (estop,)),
        Target("reset", reset_time, (LiraError,), (msgspec.json.encode(12.5),)),
        Target("world", partial(msgspec.json.decode, type=World), json_errors, (world,)),
        Target("picture", decode_picture, (LiraError,), pictures),
    ]


def decode_picture(data: bytes) -> object:
    """As a picture goes: off the bus, then to what the networks see."""
    return gray_image(decode(CompressedImage, encode(CompressedImage(1.0, data))), 32)


def run(inputs: int = INPUTS, seed: int = SEED) -> list[Row]:
    """Return a row for each decoder. Raises `AssertionError` with the input for an error that is not the decoder's."""
    found = targets()
    return [attack(target, inputs // len(found) + 1, random.Random(f"{seed} {target.name}")) for target in found]


def attack(target: Target, inputs: int, chance: random.Random) -> Row:
    """Feed one decoder."""
    accepted, slowest_s = 0, 0.0
    for _ in range(inputs):
        data = spoil(chance.choice(target.valid), chance) if chance.random() < 0.5 else garbage(chance)
        began_s = time.thread_time()
        try:
            target.decode(data)
            accepted += 1
        except target.errors:
            pass
        except Exception as error:
            raise AssertionError(f"{target.name}: {type(error).__name__} on {data.hex()}") from error
        slowest_s = max(slowest_s, time.thread_time() - began_s)
    if slowest_s > SLOW_S:
        raise AssertionError(f"{target.name}: an input took {slowest_s:.2f} s")
    return {
        "decoder": target.name,
        "inputs": inputs,
        "accepted": accepted,
        "refused": inputs - accepted,
        "slowest_ms": 1e3 * slowest_s,
    }


def garbage(chance: random.Random) -> bytes:
    """Random bytes, every other time behind the header of CDR."""
    head = b"\0\1\0\0" if chance.random() < 0.5 else b""
    return head + chance.randbytes(chance.randrange(LONGEST))


def spoil(valid: bytes, chance: random.Random) -> bytes:
    """Change, cut out and put in, a few times."""
    data = bytearray(valid)
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(data) + 1)
        what = chance.randrange(4)
        if what == 0:
            data[at : at + 1] = chance.randbytes(1)
        elif what == 1:
            del data[at : at + chance.randint(1, 16)]
        elif what == 2:
            data[at:at] = chance.randbytes(chance.randint(1, 16))
        else:
            data[at : at + 4] = chance.choice((b"\xff\xff\xff\xff", b"\0\0\0\0", b"\xff\xff\xff\x7f", b"\0\0\xc0\x7f"))
    return bytes(data)
