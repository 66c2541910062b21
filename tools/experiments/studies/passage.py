"""Figure 7: the novice before the passage that only the camera sees is closed, beside each expert alone."""

from collections.abc import Sequence
from functools import cache, partial

import numpy as np

from lira.fusion.experts.files import experts_of
from lira.fusion.experts.load import load_policy
from lira.fusion.log.recorder import Journal
from lira.fusion.log.run_log import LapRecord
from lira.fusion.methods.base import Alone
from lira.fusion.methods.presets import METHODS
from lira.hal.messages import Phase
from lira.tools.experiments.effort.measures import by_method, median, method_rows
from lira.tools.experiments.experiment import Experiment, Finding, Outcomes, Picture, Row, Table
from lira.tools.experiments.notes import Notes, Track
from lira.tools.experiments.trial import Outcome, Trial
from lira.tools.runs.course import Course, run_course
from lira.tools.runs.simulated import simulate

WORLD = "passage"
PRESETS = ("thesis", "hold")
WALL_MM = 6000  # where the wall stands
THESIS_LABELS, THESIS_STEPS = 30, 1  # Table I: what this novice had learned from


def trials(seeds: int) -> list[Trial]:
    """Both presets on every seed."""
    return [Trial(METHODS[preset], WORLD, seed, unseen=0) for preset in PRESETS for seed in range(seeds)]


@cache
def alone(name: str, trial: Trial) -> tuple[LapRecord, Track]:
    """Drive the passage with one expert and nobody to help, as far as it comes."""
    expert = load_policy(f"{name}-expert", trial.profile, trial.pair)
    notes, method = Notes(), Alone(name, expert.act)
    with simulate(trial.world, trial.profile, renderer="sketch") as robot:
        course = Course(trial.profile, robot.arena.world)
        run_course(robot, robot.arena, method, None, Journal(write=notes.record), course)
    return notes.laps[0], notes.tracks[0]


def row(group: Sequence[Outcome]) -> Row:
    """How a preset's novices came by; medians over the seeds."""
    taught = [[track for track in outcome.tracks if track.phase == Phase.TRAIN] for outcome in group]
    return {
        "n": len(group),
        "passed": sum(outcome.result.converged for outcome in group),
        "laps": median([outcome.result.laps for outcome in group]),
        "buffer": median([outcome.result.buffer for outcome in group]),
        "training_steps": median([outcome.result.training_steps for outcome in group]),
        "human_labels": median([outcome.result.human_labels for outcome in group]),
        "interventions": median([outcome.result.interventions for outcome in group]),
        "slowed_steps": median([outcome.result.account.slowed_steps for outcome in group]),
        "slowest_m_s": median([min(map(slowest_m_s, tracks)) for tracks in taught]),
    }


def slowest_m_s(track: Track) -> float:
    """Least speed between the first metre and the wall."""
    speeds = [speed for x, speed in zip(track.x_mm, track.speed_mm_s, strict=True) if 1000 < x < WALL_MM]
    return min(speeds, default=0) / 1000


def end(record: LapRecord, track: Track) -> str:
    """How a drive ended, in a word."""
    if record.passed:
        return "finished"
    if record.collisions:
        return "collided"
    if record.lost:
        return f"lost to the {'left' if track.y_mm[-1] > 0 else 'right'}"
    return f"stood at x = {track.x_mm[-1] / 1000:.1f} m"


def side_m(track: Track) -> float | None:
    """Where a drive crossed the wall's line, metres to the left of straight ahead; None if it never did."""
    past = np.flatnonzero(np.asarray(track.x_mm) >= WALL_MM)
    return track.y_mm[past[0]] / 1000 if past.size else None


def final(group: Sequence[Outcome]) -> Track | None:
    """The first seed's last proving run."""
    return next((track for track in reversed(group[0].tracks) if track.phase == Phase.PROVE), None)


def drives(outcomes: Outcomes) -> list[Row]:
    """Each expert alone, and the first seed's final novices."""
    shown = {f"{name} expert": alone(name, outcomes[0].trial) for name in experts_of(outcomes[0].trial.profile)}
    for method, group in by_method(outcomes).items():
        proofs = [each for each in group[0].laps if each.phase == Phase.PROVE]
        track = final(group)
        if proofs and track is not None:
            shown[f"novice, {method}"] = proofs[-1], track
    return [
        {"driver": driver, "end": end(record, track), "crosses_wall_at_m": side_m(track)}
        for driver, (record, track) in shown.items()
    ]


def tables(outcomes: Outcomes) -> list[Table]:
    """What the novices took, and who comes by the wall where."""
    thesis: Row = {"method": "Table I", "n": 1, "passed": 1, "buffer": THESIS_LABELS, "training_steps": THESIS_STEPS}
    note = (
        "The gap is 0.2 to 0.9 m left of straight ahead, open at the lidar's height; the way round is to the right. "
        "The course that the lidar expert is trained on was made stricter after it had been seen here."
    )
    return [
        Table("Novices that learned to pass the wall", [*method_rows(outcomes, row), thesis]),
        Table("Drives alone (the first seed's novices)", drives(outcomes), note),
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Where the lidar sees an opening the robot slows and calls, and the novice learns to turn away."""
    ends = {str(each["driver"]): str(each["end"]) for each in drives(outcomes)}
    lidar, camera = ends["lidar expert"], ends["camera expert"]
    found = [
        Finding("fig7.lidar", "the lidar expert alone drives into the gap", "yes", lidar, lidar == "collided"),
        Finding("fig7.camera", "the camera expert alone goes round to the right", "yes", camera, camera == "finished"),
    ]
    for each in method_rows(outcomes, row):
        method, n = each["method"], each["n"]
        slowed, speed = float(str(each["slowed_steps"])), float(str(each["slowest_m_s"]))
        words = f"{slowed:g} slowed steps, least speed {speed:.2f} m/s"
        found += [
            Finding(f"fig7.{method}.slows", f"{method}: slows and calls before the wall", "yes", words, slowed > 0),
            Finding(
                f"fig7.{method}.passes",
                f"{method}: the novice passes alone",
                "yes",
                f"{each['passed']} of {n}",
                each["passed"] == n,
            ),
        ]
    return found


def figures(outcomes: Outcomes) -> list[Picture]:
    """Training, the final drives and the experts alone from above."""
    from lira.tools.experiments.output import plots

    trial = outcomes[0].trial
    tracks = {f"{name} expert alone": alone(name, trial)[1] for name in experts_of(trial.profile)}
    for method, group in by_method(outcomes).items():
        tracks[f"training, {method}"] = group[0].tracks[0]
        proven = final(group)
        if proven is not None:
            tracks[f"novice, {method}"] = proven
    words = "The passage; the colour is the speed, a dot a decision (thesis, fig. 7)"
    full_speed_m_s = trial.profile.base.max_linear_m_s
    return [Picture("passage", words, partial(plots.top_view, WORLD, tracks, full_speed_m_s))]


EXPERIMENTS = {"fig7": Experiment(trials=trials, tables=tables, findings=findings, figures=figures)}
