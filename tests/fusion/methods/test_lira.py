"""Algorithm 1, row by row of the table in the module it tests."""

import itertools

import numpy as np
import pytest
from taught import FixedNetwork

from lira.fusion.learning.novice import LearningSettings, NetworkNovice, is_redundant
from lira.fusion.log.counts import Ledger
from lira.fusion.methods.base import Expert
from lira.fusion.methods.lira import PRESETS, LiraSettings, LiraSpf, activation, choose, in_consensus
from lira.fusion.preprocess import Features
from lira.hal.messages import Call, ExpertView

T = 0.20
NOVICE = (0.9, -0.3)
FEATURES = Features(scan=np.zeros(101, np.float32), image=np.zeros((32, 32), np.float32))


def expert(name, action, *, active):
    return ExpertView(name, action, 0.1 if active else 0.0, active)


def camera(*, active, action=(1.0, 0.5)):
    return expert("camera", action, active=active)


def lidar(*, active, action=(1.0, -0.5)):
    return expert("lidar", action, active=active)


@pytest.mark.parametrize(("first", "second"), list(itertools.product([False, True], repeat=2)))
def test_the_human_in_control_wins_whatever_the_experts_do(first, second):
    choice = choose((0.2, 1.0), [camera(active=first), lidar(active=second)], NOVICE, T)
    assert (choice.driver, choice.action, choice.label, choice.call) == ("human", (0.2, 1.0), (0.2, 1.0), Call.NONE)


def test_nobody_active_leaves_the_wheel_to_the_novice_and_stores_nothing():
    choice = choose(None, [camera(active=False), lidar(active=False)], NOVICE, T)
    assert (choice.driver, choice.action, choice.label, choice.call) == ("novice", NOVICE, None, Call.NONE)


@pytest.mark.parametrize("name", ["camera", "lidar"])
def test_a_single_active_expert_drives_teaches_and_calls_for_attention(name):
    views = [camera(active=name == "camera"), lidar(active=name == "lidar")]
    choice = choose(None, views, NOVICE, T)
    action = {"camera": (1.0, 0.5), "lidar": (1.0, -0.5)}[name]
    assert (choice.driver, choice.action, choice.label, choice.call) == (name, action, action, Call.ATTENTION)


def test_two_active_experts_in_consensus_drive_with_their_mean_and_call_nobody():
    choice = choose(None, [camera(active=True), lidar(active=True, action=(0.9, 0.4))], NOVICE, T)
    assert choice.driver == "mean"
    assert choice.action == choice.label == pytest.approx((0.95, 0.45))
    assert choice.call is Call.NONE


def test_two_active_experts_without_consensus_call_for_feedback_while_the_novice_drives():
    """Regression: read literally, the printed algorithm gives control to one of them."""
    choice = choose(None, [camera(active=True), lidar(active=True)], NOVICE, T)
    assert (choice.driver, choice.action, choice.label, choice.call) == ("novice", NOVICE, None, Call.FEEDBACK)


def test_with_three_experts_every_active_pair_has_to_agree():
    third = expert("sonar", (1.0, 0.35), active=True)
    near = [camera(active=True), lidar(active=True, action=(1.0, 0.45)), third]
    far = [camera(active=True), lidar(active=True, action=(1.0, 0.6)), third]
    agreed = choose(None, near, NOVICE, T)
    assert agreed.driver == "mean"
    assert agreed.action == agreed.label == pytest.approx((1.0, (0.5 + 0.45 + 0.35) / 3))
    assert choose(None, far, NOVICE, T).call is Call.FEEDBACK
    # neighbours agree, the outer two do not
    chain = [camera(active=True), lidar(active=True, action=(1.0, 0.65)), expert("depth", (1.0, 0.8), active=True)]
    assert choose(None, chain, NOVICE, T).call is Call.FEEDBACK
    # the one that disagrees is not active: it has no say
    quiet = [camera(active=True), lidar(active=False, action=(1.0, 0.9)), third]
    two = choose(None, quiet, NOVICE, T)
    assert two.driver == "mean"
    assert two.action == pytest.approx((1.0, (0.5 + 0.35) / 2))
    alone = choose(None, [camera(active=False), lidar(active=False), third], NOVICE, T)
    assert (alone.driver, alone.label, alone.call) == ("sonar", (1.0, 0.35), Call.ATTENTION)


def test_consensus_is_strict():
    assert not in_consensus([(0.0, 0.0), (0.25, 0.0)], 0.25)
    assert in_consensus([(0.0, 0.0), (0.2499, 0.0)], 0.25)
    assert not in_consensus([(0.0, 0.0), (0.0, -0.3)], 0.25)


def test_activation_is_the_population_deviation_summed_over_dimensions():
    s = [(1.0, 0.0), (1.0, 0.2), (0.8, 0.4), (1.0, 0.2), (1.0, 0.0)]
    by_hand = 0
    for k in range(2):
        column = [row[k] for row in s]
        mean = sum(column) / 5
        by_hand += (sum((x - mean) ** 2 for x in column) / 5) ** 0.5
    assert activation(s) == pytest.approx(by_hand)
    assert activation([(1.0, 1.0)] * 5) == 0.0


class NoTrainer:
    """A trainer that delivers the weights it is told to, when it is told to."""

    pending = False

    def __init__(self):
        self.labels = []
        self.started = 0

    def add(self, label):
        self.labels.append(label)

    def start(self, now_s):
        self.started += 1
        self.pending = True

    def poll(self, now_s):
        if not self.pending:
            return None
        self.pending = False
        return {}

    def close(self):
        pass


def make_novice(*, trained=True, **settings):
    novice = NetworkNovice(FixedNetwork(NOVICE), NoTrainer(), LearningSettings(**settings))
    novice.training_steps = int(trained)
    return novice


def make_lira(actions, settings, **kwargs):
    """An algorithm whose experts play back `actions` (name -> list), one each step."""
    streams = {name: iter(sequence) for name, sequence in actions.items()}
    experts = [Expert(name, lambda _, stream=stream: next(stream)) for name, stream in streams.items()]
    return LiraSpf(experts, make_novice(**kwargs), settings, period_s=0.2)


def run(lira, steps, human=None):
    proposals = []
    for _ in range(steps):
        proposals.append(lira.propose(FEATURES))
        lira.learn(proposals[-1], human)
    return proposals


STRAIGHT = [(1.0, 0.0)] * 12


def test_experts_are_inactive_until_their_memory_is_full_and_again_after_a_reset():
    swerve = [(1.0, 0.5 * (k % 2)) for k in range(20)]
    lira = make_lira({"camera": swerve, "lidar": STRAIGHT + STRAIGHT}, PRESETS["thesis"])
    active = [p.experts[0].active for p in run(lira, 6)]
    assert active == [False] * 4 + [True] * 2
    lira.reset()
    assert [p.experts[0].active for p in run(lira, 5)] == [False] * 4 + [True]


def test_the_memory_also_fills_while_the_human_drives():
    swerve = [(1.0, 0.5 * (k % 2)) for k in range(20)]
    lira = make_lira({"camera": swerve, "lidar": STRAIGHT}, PRESETS["thesis"])
    run(lira, 5, human=(1.0, 1.0))
    assert run(lira, 1)[0].experts[0].active


def test_a_constant_hard_turn_is_inactive_in_the_thesis_and_active_with_hold():
    turn = [(1.0, 0.9)] * 12
    for preset, active in [("thesis", False), ("hold", True)]:
        lira = make_lira({"camera": turn, "lidar": STRAIGHT}, PRESETS[preset])
        assert run(lira, 6)[-1].experts[0].active is active, preset


def test_activation_has_to_exceed_theta():
    wave = [(1.0, 0.06 * (-1) ** k) for k in range(12)]  # deviation of five samples: 0.0588
    lira = make_lira({"camera": wave, "lidar": STRAIGHT}, LiraSettings(hold=None))
    assert not run(lira, 5)[-1].experts[0].active
    lira = make_lira({"camera": wave, "lidar": STRAIGHT}, LiraSettings(theta=0.029, hold=None))
    assert run(lira, 5)[-1].experts[0].active


def test_a_feedback_call_slows_both_components_and_learns_nothing():
    left = [(1.0, 0.3 * (k % 3)) for k in range(12)]
    right = [(1.0, -0.3 * (k % 3)) for k in range(12)]
    lira = make_lira({"camera": left, "lidar": right}, PRESETS["hold"])
    proposal = run(lira, 6)[-1]
    assert proposal.choice.call is Call.FEEDBACK
    assert proposal.command == pytest.approx((0.3 * 0.9, 0.3 * -0.3))
    assert proposal.choice.action == NOVICE
    assert lira.novice.stored == 0


def test_before_the_first_training_step_the_human_is_asked_to_drive():
    lira = make_lira({"camera": STRAIGHT, "lidar": STRAIGHT}, PRESETS["hold"], trained=False)
    proposal = run(lira, 1)[0]
    assert (proposal.choice.driver, proposal.command, proposal.choice.call) == ("none", (0.0, 0.0), Call.FEEDBACK)
    lira = make_lira({"camera": STRAIGHT, "lidar": STRAIGHT}, LiraSettings(start="experts"), trained=False)
    proposal = run(lira, 1)[0]
    assert (proposal.choice.driver, proposal.choice.label) == ("mean", (1.0, 0.0))


def test_one_expert_is_not_enough():
    with pytest.raises(ValueError, match="at least two"):
        make_lira({"camera": STRAIGHT}, PRESETS["hold"])


@pytest.mark.parametrize(
    ("action", "redundant"),
    [((0.95, -0.25), True), ((0.9, -0.3), True), ((0.79, -0.3), False), ((0.9, -0.21), True), ((0.9, -0.41), False)],
)
def test_a_label_is_redundant_only_if_every_component_is_near(action, redundant):
    assert is_redundant(action, NOVICE, 0.0999) is redundant
    assert make_novice().learn(FEATURES, action, "lidar", NOVICE) is (not redundant)


def test_the_filter_spares_human_labels_only_if_told_so():
    assert not make_novice().learn(FEATURES, NOVICE, "human", NOVICE)
    assert make_novice(filter_human=False).learn(FEATURES, NOVICE, "human", NOVICE)
    assert not make_novice(filter_human=False).learn(FEATURES, NOVICE, "lidar", NOVICE)


def test_training_starts_every_m_stored_labels_and_carries_the_remainder():
    novice = make_novice(trained=False, labels_per_step=3)
    steps = []
    for k in range(8):
        novice.learn(FEATURES, (-1.0, 1.0), "human", NOVICE)
        novice.update(now_s=k)
        steps.append(novice._trainer.started)
    assert steps == [0, 0, 1, 1, 1, 2, 2, 2]
    assert novice.trained
    assert novice.training_steps == 2


def test_the_ledger_counts_interventions_by_edges_and_the_demonstration_apart():
    ledger = Ledger()
    lira = make_lira({"camera": STRAIGHT, "lidar": STRAIGHT}, PRESETS["hold"])
    human = (0.0, 1.0)
    for first, who in [(True, human), (True, human), (False, human), (False, None), (False, human), (False, human)]:
        ledger.note(lira.learn(lira.propose(FEATURES), who), now_s=0.0, demonstrating=first)
    assert ledger.interventions == 1  # the demonstration, which went on into the first steps, is none
    assert ledger.labels.demonstration == 2
    assert (ledger.labels.given_human, ledger.labels.stored_human) == (3, 3)
    assert ledger.buffer == 5
