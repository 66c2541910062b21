"""`lira.drive` and `lira.teach` on a robot of this process."""

import pytest

import lira
from lira.fusion.methods.presets import method_named
from lira.hal.testing import NullRobot
from lira.tools.runs.folder import snapshot
from lira.tools.runs.plan import Plan

PROFILE = lira.load_profile("thesis-sim")


def ahead(seen):
    return 0.5, 0.0


def speed_m_s(robot):
    """How fast it goes a moment later."""
    robot.wait(robot.now() + 0.1)
    return robot.read().odom.linear_m_s


def test_it_yields_each_decision_and_then_the_robot_stands():
    with lira.govern(NullRobot(PROFILE)) as robot:
        steps = list(lira.drive(robot, ahead, steps=4))
        assert len(steps) == 4
        assert {step.proposal.choice.driver for step in steps} == {"ahead"}
        assert steps[-1].applied.twist.linear_m_s == 0.5
        assert speed_m_s(robot) == 0.0


def test_the_robot_stands_when_nobody_asks_for_more():
    with lira.govern(NullRobot(PROFILE)) as robot:
        driving = lira.drive(robot, ahead)
        next(driving)
        driving.close()
        assert speed_m_s(robot) == 0.0


@pytest.mark.parametrize("shield", [False, True])
def test_behind_a_shield_one_that_sees_nothing_hits_nothing(shield):
    with lira.simulate("forest", renderer="tiny") as robot:
        steps = list(lira.drive(robot, lambda _: (1.0, 0.0), steps=40, shield=shield))
    changed = [step for step in steps if step.proposal.choice.driver == "shield"]
    assert bool(changed) is shield
    assert any(step.state.collided for step in steps) is not shield
    assert all(step.proposal.novice == (1.0, 0.0) for step in steps)


def test_a_robot_without_a_governor_is_refused_before_it_moves():
    with pytest.raises(lira.LiraError, match=r"a NullRobot has no governor.*lira\.govern"):
        lira.drive(NullRobot(PROFILE), ahead)


def test_one_who_needs_no_teacher_has_a_proving_run_at_once():
    class Straight(lira.Method):
        def __init__(self, context):
            self.experts = context.experts

        def propose(self, features):
            return lira.Proposal(features, lira.Choice("straight", (1.0, 0.0)))

    lines = []
    with lira.simulate("lane", renderer="tiny") as robot:
        taught = lira.teach(robot, Straight, more_experts=[ahead], unseen=0, say=lines.append)
    assert [lap.phase for lap in taught.laps] == ["prove"]
    assert not taught.converged  # there is a box on the lane
    assert lines[0].startswith("Straight (Straight) on lane")


def test_a_novice_without_a_network_leaves_its_labels(tmp_path):
    novice = lira.LearnedPolicy()
    head = Plan(method_named("hold")).head(PROFILE, "lane")
    assert "there is no novice yet" in snapshot(tmp_path, novice, PROFILE, head)()
    novice.stored, novice.training_steps = 3, 1
    assert "saved 3 labels learned" in snapshot(tmp_path, novice, PROFILE, head)()
    assert list(tmp_path.iterdir()) == []
