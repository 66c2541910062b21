"""Every way of teaching by name: the one table of those that come with the project, and the door to a user's own.

What belongs to an approach is in its own settings; what could be combined with any of them is in `Preset`.
"""

import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import cast

import msgspec

from lira.fusion.learning.novice import LearningSettings
from lira.fusion.methods.base import Method
from lira.fusion.methods.context import Context, MethodSettings, Trunks
from lira.fusion.methods.lira import PRESETS, LiraSettings
from lira.fusion.methods.plus import PlusSettings
from lira.fusion.methods.rivals.cloning import CloningSettings
from lira.fusion.methods.rivals.ensemble_dagger import EnsembleDaggerSettings
from lira.fusion.methods.rivals.hg_dagger import HgDaggerSettings
from lira.fusion.methods.rivals.intervention_weighted import InterventionWeightedSettings
from lira.fusion.methods.rivals.lazy_dagger import LazyDaggerSettings
from lira.fusion.methods.rivals.switching import SwitchingSettings
from lira.fusion.methods.rivals.thrifty_dagger import ThriftyDaggerSettings
from lira.fusion.methods.shared_feedback import SharingSettings
from lira.fusion.methods.syllabus import FRESH, THESIS, Syllabus, with_proof
from lira.fusion.policies.kernel import KernelSettings
from lira.hal.errors import ConfigError, PluginError
from lira.hal.messages import Phase
from lira.hal.plugins import METHODS as DOOR


class OwnSettings(MethodSettings, frozen=True, tag="own"):
    """A method that does not come with the project: the name by which its settings, or what builds it, are found."""

    name: str

    def build(self, context: Context) -> Method:
        """Build it. Raises `PluginError` if what comes of that is no method."""
        method = builder(DOOR.find(self.name, {}), self.name)(context)
        if not isinstance(method, Method):
            what = f"'{self.name}' built a {type(method).__name__} and no method"
            raise PluginError(what, "Let it return a subclass of lira.Method.")
        return method

    def source(self) -> bytes:
        """Return the text of the module in which it is."""
        found = builder(DOOR.find(self.name, {}), self.name)
        path = getattr(inspect.getmodule(found), "__file__", None)
        return b"" if path is None else Path(path).read_bytes()

    @property
    def kind(self) -> str:
        """Its own name."""
        return self.name


Rival = (
    HgDaggerSettings
    | EnsembleDaggerSettings
    | LazyDaggerSettings
    | ThriftyDaggerSettings
    | InterventionWeightedSettings
    | CloningSettings
    | SwitchingSettings
)
Approach = LiraSettings | PlusSettings | Rival | OwnSettings


class Preset(msgspec.Struct, frozen=True):
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
    trunks: Trunks = "frozen"
    warm: tuple[str, ...] = ()
    mirrored: bool = False
    sharing: SharingSettings | None = None
    kernel: KernelSettings | None = None
    syllabus: Syllabus = THESIS

    @property
    def kind(self) -> str:
        """Which approach it is, in one word."""
        return self.approach.kind

    @property
    def packages(self) -> tuple[str, ...]:
        """What has to be installed to teach by it: torch, where a network is trained. A method of one's own may ask."""
        if isinstance(self.approach, OwnSettings | SwitchingSettings):
            return ()
        probes = isinstance(self.approach, LazyDaggerSettings | ThriftyDaggerSettings)
        return ("torch",) if self.kernel is None or probes else ()

    @property
    def knows_experts(self) -> bool:
        """Whether anything of the experts goes into it: what they do, their trunks, what they teach in a warm start."""
        asks_none = isinstance(self.approach, Rival) and not isinstance(self.approach, SwitchingSettings)
        sees_alone = self.trunks == "scratch" and self.kernel is None
        return not (asks_none and sees_alone and not self.warm)

    def starting(self, who: str) -> "Preset":
        """Return the same with another driver before the first training step. Raises `ConfigError`."""
        return msgspec.structs.replace(self, approach=self.approach.starting(who))

    def taught(
        self,
        *,
        start: str | None = None,
        layouts: str | None = None,
        proof: str | None = None,
        idle_frames: str | None = None,
    ) -> "Preset":
        """Return the same as a run teaches it, in the words of a command line; None: as it is. Raises `ConfigError`."""
        preset = self if start is None else self.starting(start)
        syllabus = preset.syllabus if proof is None else with_proof(preset.syllabus, proof)
        own = {"layouts": layouts} if layouts is not None else {}
        idle = {"idle_frames": idle_frames} if idle_frames is not None else {}
        return msgspec.structs.replace(
            preset,
            learning=msgspec.structs.replace(preset.learning, **idle),
            syllabus=msgspec.structs.replace(syllabus, **own),
        )

    def build(self, context: Context) -> Method:
        """Build the method from what a run has to offer. Raises `ConfigError` or `PluginError`."""
        method = self.approach.build(context)
        return method if self.sharing is None else self.sharing.around(method)


def file_name(method: str) -> str:
    """Return a method's name, fit to name a file or a folder."""
    return re.sub(r"[^\w@-]+", "-", method).strip("-")


_HOLD = PRESETS["hold"]
_HG = HgDaggerSettings()
_HEAVY = LearningSettings(labels_per_step=10, human_weight=3.0)
_M10 = LearningSettings(labels_per_step=10)
_BOTH = ("camera", "lidar")


def _plus(name: str, **changes: object) -> Preset:
    """Return `plus` with changes to it."""
    plus = Preset(name, PlusSettings(), _HEAVY, mirrored=True, kernel=KernelSettings(), syllabus=FRESH)
    return msgspec.structs.replace(plus, **changes)


def with_kernel(method: Preset) -> Preset:
    """Return a method with everything of `plus` that is no part of a method: its novice, its layouts, its proof.

    So what a method asks of the person is told apart from what the learner makes of it.
    """
    return _plus(f"{method.name}-kernel", approach=method.approach)


def on_fresh_layouts(method: Preset) -> Preset:
    """Return a method as it is, each training lap on a layout of its own."""
    return msgspec.structs.replace(method, name=f"{method.name}-fresh", syllabus=FRESH)


LIRA = (
    Preset("hold", _HOLD),
    Preset("thesis", PRESETS["thesis"]),
    Preset("hold-fixed", _HOLD, sharing=SharingSettings(when="fixed")),
    Preset("hold-flexible", _HOLD, sharing=SharingSettings(when="flexible")),
    Preset("thesis-fixed", PRESETS["thesis"], sharing=SharingSettings(when="fixed")),
    Preset("thesis-flexible", PRESETS["thesis"], sharing=SharingSettings(when="flexible")),
    Preset("hold-scratch", _HOLD, trunks="scratch"),
    Preset("hold-mirrored", _HOLD, mirrored=True),
)
PLUS = (
    _plus("plus"),
    _plus("plus-no-prefill", approach=PlusSettings(prefill=0)),
    _plus("plus-no-reserve", approach=PlusSettings(reserve_s=0.0)),
    _plus("plus-no-weight", learning=_M10),
    _plus("plus-no-mirror", mirrored=False),
    _plus("plus-no-handover", approach=PlusSettings(handover_s=0.0)),
    _plus("plus-no-cleaning", kernel=KernelSettings(contradicts=None)),
    _plus("plus-no-gain", kernel=KernelSettings(gain=1.0)),
    _plus("plus-no-fallback", kernel=KernelSettings(fallback=False)),
    _plus("plus-network", kernel=None),
    _plus("plus-practice", approach=PlusSettings(practice=True)),
    _plus("plus-sure", approach=PlusSettings(sure=0.25)),
    _plus("plus-ask", approach=PlusSettings(ask=True)),
    _plus("plus-own", syllabus=THESIS),
)
# As their papers have them: a network of their own, which learns all it knows from the person.
RIVALS = (
    Preset("hg-dagger", _HG, trunks="scratch"),
    Preset("ensemble-dagger", EnsembleDaggerSettings(), trunks="scratch"),
    Preset("lazy-dagger", LazyDaggerSettings(), trunks="scratch"),
    Preset("thrifty-dagger", ThriftyDaggerSettings(), trunks="scratch"),
    Preset("iwr", InterventionWeightedSettings(), trunks="scratch"),
    Preset("sirius", InterventionWeightedSettings(before_s=1.0), trunks="scratch"),
    Preset("cloning", CloningSettings(), LearningSettings(filter_human=False), trunks="scratch"),
)
HG_DAGGER = (
    Preset("hg-dagger-m10", _HG, _M10, trunks="scratch"),
    Preset("hg-dagger-mirrored", _HG, trunks="scratch", mirrored=True),
    Preset("hg-dagger-doubt", HgDaggerSettings(doubt=(Phase.UNSEEN,)), trunks="scratch"),
    Preset("hg-dagger-trunks", _HG),
    Preset("hg-dagger-warm", _HG, warm=_BOTH),
    Preset("hg-dagger-warm-m10", _HG, _M10, warm=_BOTH),
    Preset("hg-dagger-warm-m10-mirrored", _HG, _M10, warm=_BOTH, mirrored=True),
)
METHODS = {
    method.name: method
    for method in (
        *LIRA,
        *PLUS,
        *RIVALS,
        *HG_DAGGER,
        *map(on_fresh_layouts, (LIRA[0], *RIVALS)),
        *map(with_kernel, (LIRA[0], *RIVALS)),
        Preset("switching", SwitchingSettings()),
    )
}
ALIASES = {"lira": "hold"}


def method_named(name: str) -> Preset:
    """Look a method up, or load a user's own: MODULE:OBJECT.

    That object is a `Preset`, a `MethodSettings` or a subclass of it, or anything that makes a `Method` of a `Context`,
    such as a subclass of `Method`. Raises `ConfigError` for a name that is none, `PluginError` if it does not load.
    """
    found = DOOR.find(name, {**{alias: METHODS[of] for alias, of in ALIASES.items()}, **METHODS})
    if isinstance(found, Preset) and found is METHODS.get(found.name):
        return found
    builder(found, name)
    own = OwnSettings(name=name)
    return msgspec.structs.replace(found, name=name, approach=own) if isinstance(found, Preset) else Preset(name, own)


def builder(found: object, name: str) -> Callable[[Context], object]:
    """Return what builds the method that a plug-in offers under this name. Raises `ConfigError` if nothing does."""
    if isinstance(found, Preset):
        found = found.approach
    if isinstance(found, type) and issubclass(found, MethodSettings):
        found = found()
    if isinstance(found, MethodSettings):
        return found.build
    if not callable(found):
        what = f"the method '{name}' is a {type(found).__name__}"
        raise ConfigError(what, "Give a lira.MethodSettings, or a lira.Method that is made from a lira.Context.")
    return cast(Callable[[Context], object], found)
