"""Outcomes with numbers chosen by hand, to check what is computed from them."""

from lira.fusion.log.counts import Account
from lira.fusion.log.run_log import LapRecord, ResultRecord
from lira.fusion.methods.presets import METHODS
from lira.tools.experiments.methods import LIRA
from lira.tools.experiments.notes import Track
from lira.tools.experiments.trial import Outcome, Trial

HOLD = LIRA[0].name


def lap(phase="train", number=1, **changes):
    fields = {
        "phase": phase, "lap": number, "layout": 0, "passed": True, "unassisted": False, "duration_s": 60.0,
        "collisions": 0, "lost": 0, "lateral_rms_m": 0.25, "human_labels": 20, "interventions": 4, "calls": 6,
        "buffer": 50, "training_steps": 2, "elapsed_s": 1.0,
    }  # fmt: skip
    return LapRecord(**(fields | changes))


def outcome(method, seed=0, *, labels=40, interventions=8, converged=True, world="race", laps=None, **fields):
    account = fields.pop("account", Account(human_steps=50, given={"human": 45}, stored={"human": labels}))
    result = ResultRecord(converged, 2, labels, 30, interventions, 12, 90, 3, 120.0, 6.0, account)
    laps = laps or (lap(), lap("prove"), lap(number=2, buffer=90), lap("prove", 2), lap("unseen"))
    tracks = tuple(
        Track(phase, number, seed, (0, 100, 300), (0, 0, 10), (0, 500, 1000), ("human", "novice", "novice"))
        for phase, number in (("train", 1), ("prove", 2), ("unseen", 1))
    )
    labels_kept = fields.pop("kept", {"human": ((1.0, 1.0), (1.0, 0.0)), "camera": ((1.0, 0.3), (0.95, -0.4))})
    trial = Trial(METHODS[method], world, seed, **fields)
    return Outcome(trial, laps, result, labels_kept, tracks, "f" * 16)
