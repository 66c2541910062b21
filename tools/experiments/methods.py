"""The methods that are compared. Same network, same frozen trunks, same teacher: only the method differs."""

from fusion.lira import PRESETS
from fusion.novice import LearningSettings
from tools.experiments.trial import Method

LIRA = (Method("lira-hold", PRESETS["hold"]), Method("lira-thesis", PRESETS["thesis"]))
HG_DAGGER = (
    Method("hg-dagger"),
    Method("hg-dagger-m10", learning=LearningSettings(labels_per_step=10)),
    Method("hg-dagger-warm", warm=True),
)
