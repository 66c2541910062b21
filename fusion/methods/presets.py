"""Every way of teaching that comes with the project, by name: the one table that commands, experiments and tests use.

What belongs to an approach is in its own settings; what could be combined with any of them is in `Method`.
"""

from typing import Literal

import msgspec

from lira.fusion.learning.novice import LearningSettings
from lira.fusion.methods.cloning import CloningSettings
from lira.fusion.methods.hg_dagger import HgDaggerSettings
from lira.fusion.methods.lira import PRESETS, LiraSettings
from lira.fusion.methods.plus import PlusSettings
from lira.fusion.methods.shared_feedback import SharingSettings
from lira.fusion.methods.switching import SwitchingSettings
from lira.fusion.methods.syllabus import FRESH, THESIS, Syllabus
from lira.fusion.policies.kernel import KernelSettings
from lira.hal.errors import ConfigError

Approach = LiraSettings | PlusSettings | HgDaggerSettings | CloningSettings | SwitchingSettings
Sensor = Literal["camera", "lidar"]


class Method(msgspec.Struct, frozen=True):
    """A way of teaching by name.

    `trunks`: "frozen" copies of the experts' trunks, or "scratch" (everything is learned). HG-DAgger and cloning know
    no experts, so they learn from scratch; variants of HG-DAgger that profit from experts say so in their name.
    `warm` names the experts that teach the novice what they do on their own training course before any human does.
    `mirrored` learns every label once more with left and right exchanged. `sharing` adds Appendix D to LIRA-SPF.
    `kernel`: the novice is that regression on the experts' trunks instead of a network. `syllabus`: on which layouts it
    is taught and proven.
    """

    name: str
    approach: Approach
    learning: LearningSettings = LearningSettings()
    trunks: Literal["frozen", "scratch"] = "frozen"
    warm: tuple[Sensor, ...] = ()
    mirrored: bool = False
    sharing: SharingSettings | None = None
    kernel: KernelSettings | None = None
    syllabus: Syllabus = THESIS

    @property
    def kind(self) -> str:
        """Which approach it is, in one word."""
        return str(type(self.approach).__struct_config__.tag)


_HOLD = PRESETS["hold"]
_HG = HgDaggerSettings()
_HEAVY = LearningSettings(labels_per_step=10, human_weight=3.0)
_M10 = LearningSettings(labels_per_step=10)
_BOTH: tuple[Sensor, ...] = ("camera", "lidar")


def _plus(name: str, **changes: object) -> Method:
    """Return `plus` with changes to it."""
    plus = Method(name, PlusSettings(), _HEAVY, mirrored=True, kernel=KernelSettings(), syllabus=FRESH)
    return msgspec.structs.replace(plus, **changes)


METHODS = {
    method.name: method
    for method in (
        Method("hold", _HOLD),
        Method("thesis", PRESETS["thesis"]),
        Method("hold-fixed", _HOLD, sharing=SharingSettings(when="fixed")),
        Method("hold-flexible", _HOLD, sharing=SharingSettings(when="flexible")),
        Method("thesis-fixed", PRESETS["thesis"], sharing=SharingSettings(when="fixed")),
        Method("thesis-flexible", PRESETS["thesis"], sharing=SharingSettings(when="flexible")),
        Method("hold-scratch", _HOLD, trunks="scratch"),
        Method("hold-mirrored", _HOLD, mirrored=True),
        _plus("plus"),
        _plus("plus-no-prefill", approach=PlusSettings(prefill=0)),
        _plus("plus-no-reserve", approach=PlusSettings(reserve_s=0.0)),
        _plus("plus-no-weight", learning=_M10),
        _plus("plus-no-mirror", mirrored=False),
        _plus("plus-no-wheel", approach=PlusSettings(wheel_s=0.0)),
        _plus("plus-no-cleaning", kernel=KernelSettings(contradicts=None)),
        _plus("plus-no-gain", kernel=KernelSettings(gain=1.0)),
        _plus("plus-network", kernel=None),
        _plus("plus-sure", approach=PlusSettings(sure=0.25)),
        _plus("plus-ask", approach=PlusSettings(ask=True)),
        _plus("plus-own", syllabus=THESIS),
        Method("hg-dagger", _HG, trunks="scratch"),
        Method("hg-dagger-m10", _HG, _M10, trunks="scratch"),
        Method("hg-dagger-mirrored", _HG, trunks="scratch", mirrored=True),
        Method("hg-dagger-doubt", HgDaggerSettings(doubt=("unseen",)), trunks="scratch"),
        Method("hg-dagger-trunks", _HG),
        Method("hg-dagger-warm", _HG, warm=_BOTH),
        Method("hg-dagger-warm-m10", _HG, _M10, warm=_BOTH),
        Method("hg-dagger-warm-m10-mirrored", _HG, _M10, warm=_BOTH, mirrored=True),
        Method("hg-dagger-fresh", _HG, trunks="scratch", syllabus=FRESH),
        Method("hg-dagger-kernel", _HG, _HEAVY, mirrored=True, kernel=KernelSettings(), syllabus=FRESH),
        Method("hold-kernel", _HOLD, _HEAVY, mirrored=True, kernel=KernelSettings(), syllabus=FRESH),
        Method("cloning", CloningSettings(), LearningSettings(filter_human=False), trunks="scratch"),
        Method("switching", SwitchingSettings()),
    )
}
ALIASES = {"lira": "hold"}


def method_named(name: str) -> Method:
    """Look a method up. Raises `ConfigError` for a name that is none."""
    try:
        return METHODS[ALIASES.get(name, name)]
    except KeyError:
        raise ConfigError(f"unknown method '{name}'", f"Known: {', '.join([*ALIASES, *METHODS])}.") from None
