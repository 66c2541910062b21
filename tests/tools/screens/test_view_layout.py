"""The layout that comes with the wheel shows topics and fields that there are."""

import json
import re

import pytest
from foxglove import layouts

from lira.hal.bus.topics import TOPICS
from lira.hal.messages import Reason
from lira.hal.messages.ros.types import TYPES
from lira.tools.cli import main
from lira.tools.view.layout import layout_text

TYPES_BY_TOPIC = {f"/rosbot/{topic.key}": topic.ros_type for topic in TOPICS}
SCALAR, NAMED, ARRAY, SEQUENCE = 1, 2, 3, 4  # kinds of a field in a rosbags typestore


def load_layout():
    return json.loads(layout_text("rosbot"))


def topics_and_paths(layout):
    """Which topics it shows, and which paths into messages it plots."""
    topics, paths = set(), set()
    for panel in layout["configById"].values():
        topics |= set(panel.get("topics", {}))
        image = panel.get("imageMode", {})
        topics |= {image[key] for key in ("imageTopic", "calibrationTopic") if key in image}
        topics |= {panel[key] for key in ("topicPath", "topicToRender") if key in panel}
        topics |= {layer["topic"] for layer in panel.get("layers", {}).values() if "topic" in layer}
        paths |= {line["value"] for line in panel.get("paths", [])}
        paths |= {panel["path"]} if "path" in panel else set()
    return topics, paths


def field_of(ros_type, path):
    """The kind of what a path such as `.experts[0].activation` leads to; `KeyError` where there is no such field."""
    kind = (NAMED, ros_type)
    for name, index in re.findall(r"\.(\w+)(\[\d+\])?", path):
        fields = dict(TYPES.fielddefs[kind[1]][1])
        kind = fields[name]
        if index:
            assert kind[0] in (ARRAY, SEQUENCE), f"{name} of {ros_type} is no array"
            kind = kind[1][0]
    return kind


def leads_nowhere(path):
    topic = max((each for each in TYPES_BY_TOPIC if path.startswith(each + ".")), key=len, default=None)
    if topic is None:
        return True
    try:
        return field_of(TYPES_BY_TOPIC[topic], path[len(topic) :])[0] != SCALAR
    except (KeyError, AssertionError):
        return True


def test_every_topic_of_the_layout_is_on_the_bus():
    topics, _ = topics_and_paths(load_layout())
    assert {"/rosbot/scan", "/rosbot/camera/color/camera_info", "/rosbot/robot_description"} <= topics
    assert topics <= TYPES_BY_TOPIC.keys()


def test_every_path_of_the_layout_leads_to_a_value():
    _, paths = topics_and_paths(load_layout())
    assert len(paths) >= 15
    assert not [path for path in paths if leads_nowhere(path)]


@pytest.mark.parametrize(
    "path",
    [
        "/rosbot/odom.twist.twist.linear.w",
        "/rosbot/nothing.x",
        "/odom.twist.twist.linear.x",
        "/rosbot/lira/decision.experts[0]",
        "/rosbot/odom.pose",
    ],
)
def test_a_path_that_leads_nowhere_would_be_noticed(path):
    assert leads_nowhere(path)


def test_every_panel_of_the_layout_has_its_place_and_its_settings():
    layout = load_layout()

    def places(node):
        return [node] if isinstance(node, str) else places(node["first"]) + places(node["second"])

    assert sorted(places(layout["layout"])) == sorted(layout["configById"])


CONFIGS = {
    "3D": layouts.ThreeDeeConfig,
    "Image": layouts.ImageConfig,
    "StateTransitions": layouts.StateTransitionsConfig,
    "Plot": layouts.PlotConfig,
    "Indicator": layouts.IndicatorConfig,
    "RawMessages": layouts.RawMessagesConfig,
    "DiagnosticSummary": layouts.DiagnosticsSummaryConfig,
}


def test_every_setting_is_one_that_foxglove_has():
    for name, panel in load_layout()["configById"].items():
        known = CONFIGS[name.split("!")[0]]()._to_dict().keys() | {"title"}
        assert panel.keys() <= known, name
        for line in panel.get("paths", []):
            assert line.keys() <= layouts.PlotSeries(value="")._to_dict().keys(), name
    model = load_layout()["configById"]["3D!robot"]["layers"]["model"]
    assert model.keys() - {"layerId"} <= layouts.BaseRendererUrdfLayerSettings()._to_dict().keys()


def test_the_light_of_the_layout_has_a_colour_for_every_reason():
    rules = load_layout()["configById"]["Indicator!stands"]["rules"]
    assert {rule["rawValue"] for rule in rules} == {reason.value for reason in Reason}


def test_the_layout_is_written_where_it_is_asked_for(tmp_path, capsys):
    assert main(["view", "--layout", str(tmp_path / "lira.json")]) == 0
    assert json.loads((tmp_path / "lira.json").read_text()) == load_layout()


def test_a_robot_of_another_name_has_a_layout_of_its_own(tmp_path):
    assert main(["view", "--name", "r2", "--layout", str(tmp_path / "lira.json")]) == 0
    topics, paths = topics_and_paths(json.loads((tmp_path / "lira.json").read_text()))
    assert all(each.startswith("/r2/") for each in topics | paths)


def test_a_layout_that_cannot_be_written_is_told(tmp_path, capsys):
    assert main(["view", "--layout", str(tmp_path / "missing" / "lira.json")]) == 2
    assert "Choose another folder" in capsys.readouterr().err
