"""Numbers for Prometheus, of what was heard, read back by its own parser."""

from dataclasses import replace

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.parser import text_string_to_metric_families

from lira.hal.bus.boundary import Boundary
from lira.hal.bus.topics import APPLIED, BATTERY, DECISION, DIAGNOSTICS, ODOM, SESSION
from lira.hal.messages import (
    Applied,
    BatteryState,
    Call,
    Decision,
    DiagnosticArray,
    DiagnosticStatus,
    ExpertView,
    LabelCounts,
    Odometry,
    Reason,
    SessionState,
    Source,
    Stage,
    Twist,
)
from lira.tools.view.metrics import MOST_PARTS, Board
from lira.tools.view.source import Sample

EXPERTS = (ExpertView("camera", (1.0, 0.2), 0.4, True), ExpertView('li"dar\n', (1.0, 0.0), 0.01, False))
COUNTS = LabelCounts(given_human=5, stored_human=4, given_expert=9, stored_expert=3)
DECIDED = Decision(1.0, 7, "camera", Call.ATTENTION, (1.0, 0.2), (1.0, 0.1), None, EXPERTS, 0.06, COUNTS, 13, 2, 3)
MOVES = Applied(Twist(0.2, 0.1), 1.0, Source.POLICY, Reason.OK, (), 7, 0.05)


def told(*messages, boundary=None):
    """What Prometheus reads after these messages: values by name and labels."""
    board = Board(boundary or Boundary())
    board.note([Sample(topic, message, b"", 0) for topic, message in messages], 0.0)
    registry = CollectorRegistry()
    registry.register(board)
    families = text_string_to_metric_families(generate_latest(registry).decode())
    return {
        (sample.name, *sorted(sample.labels.values())): sample.value for family in families for sample in family.samples
    }


def test_before_anything_is_heard_nothing_is_claimed():
    assert told() == {}


def test_who_drives_and_why():
    found = told((APPLIED, MOVES), (DECISION, DECIDED), (ODOM, Odometry(1.0, 0.0, 0.0, 0.0, 0.19, 0.1)))
    assert found["lira_commander", "policy"] == 1.0
    assert found["lira_commander", "teleop"] == 0.0
    assert found["lira_reason", "ok"] == 1.0
    assert sum(value for (name, *_), value in found.items() if name == "lira_reason") == 1.0
    assert found["lira_driver", "camera"] == 1.0
    assert found["lira_call", "attention"] == 1.0
    assert found["lira_command_age_seconds",] == 0.05
    assert found["lira_linear_metres_per_second",] == 0.19


def test_how_learning_goes():
    found = told((DECISION, DECIDED), (SESSION, SessionState(1.0, Stage.PROVING, alone=0.8)))
    assert found["lira_activation", "camera"] == 0.4
    assert found["lira_activation", 'li"dar\n'] == 0.01
    assert found["lira_activation_threshold",] == 0.06
    assert found["lira_labels_total", "human", "stored"] == 4
    assert found["lira_labels_total", "expert", "given"] == 9
    assert found["lira_training_steps_total",] == 13
    assert found["lira_session_stage", "proving"] == 1.0
    assert found["lira_alone_ratio",] == 0.8


def test_only_the_newest_decision_counts():
    """Names come from the bus: who makes up ever new ones fills nobody's memory."""
    named = [replace(DECIDED, driver=f"d{number}") for number in range(1000)]
    found = told(*((DECISION, each) for each in named))
    assert [labels for name, *labels in found if name == "lira_driver"] == [["d999"]]
    assert found["lira_messages_total", "lira/decision"] == 1000


def test_health_is_told_by_part_and_parts_are_bounded():
    parts = [DiagnosticStatus(1, f"part {number}", "") for number in range(500)]
    found = told((DIAGNOSTICS, DiagnosticArray(1.0, tuple(parts))), (BATTERY, BatteryState(1.0, 11.5)))
    assert len([name for name, *_ in found if name == "lira_diagnostic_level"]) == MOST_PARTS
    assert found["lira_battery_volts",] == 11.5


def test_what_was_refused_is_told():
    boundary = Boundary()
    boundary.refuse("scan", "too long", 3)
    assert told(boundary=boundary)["lira_refused_messages_total", "scan", "too long"] == 3
