"""The answer types that are understood."""

from collections.abc import Callable, Mapping

from lira.robot.rplidar.capsules import DENSE, EXPRESS, ULTRA, ULTRA_DENSE, CapsuleDecoder
from lira.robot.rplidar.nodes import NodeDecoder
from lira.robot.rplidar.points import Decoder
from lira.robot.rplidar.protocol import Answer

MakeDecoder = Callable[[float], Decoder]
"""A decoder for a unit that takes so many seconds for a sample."""

DECODERS: Mapping[Answer, MakeDecoder] = {
    Answer.ULTRA: lambda sample_s: CapsuleDecoder(ULTRA, sample_s),
    Answer.DENSE: lambda sample_s: CapsuleDecoder(DENSE, sample_s),
    Answer.ULTRA_DENSE: lambda sample_s: CapsuleDecoder(ULTRA_DENSE, sample_s),
    Answer.EXPRESS: lambda sample_s: CapsuleDecoder(EXPRESS, sample_s),
    Answer.STANDARD: NodeDecoder,
}
