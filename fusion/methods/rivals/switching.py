"""Two experts and a fixed rule, no human and no learning (Zhou, Gao and Guan, 2019; reference 29 of the thesis).

"When the LIDAR sensor readings are within a minimum range, its network takes over control for a preset number of time
steps": the camera is then disregarded.
"""

from lira.fusion.methods.base import Choice, Expert, Method, Proposal
from lira.fusion.methods.context import Context, MethodSettings
from lira.fusion.preprocess import Features
from lira.hal.messages import ExpertView


class SwitchingSettings(MethodSettings, frozen=True, tag="switching"):
    """The thesis names neither number (both assumed)."""

    near_m: float = 1.0  # the lidar expert takes over when something is nearer than this
    steps: int = 5  # and drives at least so long

    @property
    def learns(self) -> bool:
        """Nobody learns."""
        return False

    def build(self, context: Context) -> Method:
        """Switch between the camera's and the lidar's expert."""
        camera, lidar, *_ = context.experts
        return Switching(camera, lidar, self, context.profile.features.max_range_m)


class Switching(Method):
    """The camera expert drives, and the lidar expert where something is near. `max_range_m` is that of the features."""

    def __init__(self, camera: Expert, lidar: Expert, settings: SwitchingSettings, max_range_m: float) -> None:
        self._camera, self._lidar = self.experts = camera, lidar
        self._settings = settings
        self._near = settings.near_m / max_range_m
        self.reset()

    def reset(self) -> None:
        """The camera expert begins."""
        self._left = 0

    def propose(self, features: Features) -> Proposal:
        """One of the experts drives, and nobody is called."""
        if features.scan.min() < self._near:
            self._left = self._settings.steps
        driver = self._lidar if self._left > 0 else self._camera
        self._left = max(0, self._left - 1)
        views = tuple(
            ExpertView(each.name, each.act(features), 0.0, each is driver) for each in (self._camera, self._lidar)
        )
        action = next(view.action for view in views if view.active)
        return Proposal(features, Choice(driver.name, action), experts=views)
