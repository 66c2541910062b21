"""rmw_zenoh's names, hashes, attachments and tokens, by its own documentation and against what others make of them.

The examples are those of rmw_zenoh's docs/design.md and of zenoh-bridge-ros2dds's sources, written out; the hashes are
those that ROS 2 Kilted installs beside its messages.
"""

import json
import struct

import pytest
from foreign import ros_share
from hypothesis import given
from hypothesis import strategies as st
from trigger import read_answer

from lira.hal.bus.topics import TOPICS
from lira.hal.errors import ConfigError
from lira.hal.messages.ros.types import all_types
from lira.hal.rmw.attachment import RmwAttachment, gid_of, parse_rmw_attachment
from lira.hal.rmw.hashes import type_hash
from lira.hal.rmw.names import RmwKey, check_namespace, dds_type, full_name, is_name, parse_key, ros_type
from lira.hal.rmw.qos import RosQos, parse_qos
from lira.hal.rmw.services import TRIGGER, Answer, encode_answer
from lira.hal.rmw.tokens import Endpoint, Kind, Node, Route, parse_route, parse_token

SESSION = "8b20917502ee955ac4476e0266340d5c"
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
TALKER = Endpoint(
    Node(2, SESSION, 0, "talker"),
    10,
    Kind.PUBLISHER,
    "/chatter",
    "std_msgs/msg/String",
    STRING_HASH,
    RosQos(depth=7),
)
TALKER_TOKEN = (
    f"@ros2_lv/2/{SESSION}/0/10/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/{STRING_HASH}/::,7:,:,:,,"
)
NODE_TOKEN = f"@ros2_lv/2/{SESSION}/0/0/NN/%/%/talker"
HASHES = {
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "sensor_msgs/msg/LaserScan": "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828",
    "geometry_msgs/msg/Twist": "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    "std_srvs/srv/Trigger": "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    "service_msgs/msg/ServiceEventInfo": "41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45",
}
words = st.text("abcdefghij/%*§@$#?~_:,0123456789 é\0", max_size=40)


def test_keys_and_tokens_are_those_of_the_documentation():
    assert TALKER.token == TALKER_TOKEN
    assert TALKER.node.token == NODE_TOKEN
    assert TALKER.key == f"2/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"
    assert parse_token(TALKER_TOKEN) == TALKER
    assert parse_token(NODE_TOKEN) == TALKER.node
    assert parse_key(TALKER.key) == RmwKey(2, "chatter", "std_msgs/msg/String", STRING_HASH)


@pytest.mark.parametrize("ros_name", HASHES)
def test_the_hash_of_a_type_is_the_one_that_ros_installs_with_it(ros_name):
    assert type_hash(ros_name) == f"RIHS01_{HASHES[ros_name]}"


def test_every_type_of_an_installed_ros_has_the_same_hash_here():
    files = list(ros_share().glob("*/*/*.json"))
    listed = [entry for file in files for entry in json.loads(file.read_text()).get("type_hashes", [])]
    known = {
        entry["type_name"]: entry["hash_string"] for entry in listed if entry["type_name"] in all_types().fielddefs
    }
    missing = {topic.ros_type for topic in TOPICS} - known.keys()
    assert {name.partition("/")[0] for name in missing} <= {"lira_msgs", "tf2_msgs"}  # tf2_msgs is on no index
    assert {name: type_hash(name) for name in known} == known


def test_an_attachment_is_33_bytes_and_the_earlier_form_is_read_too():
    sent = RmwAttachment(7, 1_700_000_000_000_000_123, bytes(range(16)))
    data = sent.to_bytes()
    assert data == struct.pack("<qqB", 7, 1_700_000_000_000_000_123, 16) + bytes(range(16))
    assert len(data) == 33
    assert parse_rmw_attachment(data) == sent
    earlier = b"\x0fsequence_number" + data[:8] + b"\x10source_timestamp" + data[8:16] + b"\x0asource_gid" + data[16:]
    assert parse_rmw_attachment(earlier) == sent
    for other in (None, b"", data[:-1], bytes(33), bytes(37), earlier.replace(b"gid", b"did"), earlier[:-1]):
        assert parse_rmw_attachment(other) is None


@given(st.binary(max_size=120))
def test_no_attachment_does_harm(data):
    found = parse_rmw_attachment(data)
    assert found is None or found.to_bytes()[:16] in (data[:16], data[16:24] + data[41:49])


@given(words)
def test_no_key_or_token_does_harm(text):
    for parse in (parse_key, parse_token, parse_route, parse_qos, ros_type):
        parse(text)
    parts = text.split("/")
    for parse in (parse_token, parse_route):
        parse("/".join(["@ros2_lv", "0", *parts]))
        parse("/".join(["@", "x", "@ros2_lv", *parts]))


@given(st.integers(0, 12), words)
def test_a_token_with_one_part_spoilt_is_none_or_whole(place, text):
    parts = TALKER_TOKEN.split("/")
    parts[place] = text
    found = parse_token("/".join(parts))
    assert found is None or (isinstance(found, Endpoint | Node) and is_name(found.name))


@given(st.builds(RosQos, st.booleans(), st.booleans(), st.none() | st.integers(0, 10**6)))
def test_quality_of_service_comes_back_as_it_was_written(qos):
    assert parse_qos(qos.encode()) == (RosQos(qos.reliable, qos.latched, 42) if qos.depth == 42 else qos)


def test_quality_of_service_is_written_as_rmw_zenoh_writes_it():
    assert RosQos(depth=10).encode() == "::,10:,:,:,,"
    assert RosQos(reliable=False, depth=5).encode() == "2::,5:,:,:,,"
    assert RosQos(latched=True, depth=1).encode() == ":1:,1:,:,:,,"
    assert RosQos(depth=42).encode() == "::,:,:,:,,"
    assert RosQos(depth=None).encode() == "::2,:,:,:,,"
    assert parse_qos("1:2:1,10:0,0:,:1,,") == RosQos(depth=10)
    assert parse_qos("::") is None


def test_a_bridges_route_is_read_and_written():
    token = "@/abc/@ros2_lv/MP/robot1§scan/sensor_msgs§msg§LaserScan/:::"
    route = Route("abc", Kind.PUBLISHER, "robot1/scan", "sensor_msgs/msg/LaserScan")
    assert parse_route(token) == route
    assert route.token == token
    service = Route("abc", Kind.SERVICE, "estop/press", TRIGGER)
    assert service.token == "@/abc/@ros2_lv/SS/estop§press/std_srvs§srv§Trigger"
    assert parse_route(service.token) == service
    assert parse_route("@/abc/@ros2_lv/AS/dock/x§action§Dock") is None
    assert parse_route(TALKER_TOKEN) is None


def test_names_are_told_from_what_ros_does_not_take():
    for name in ("/scan", "scan", "/robot1/camera/color/image_raw", "~private", "_hidden"):
        assert is_name(name), name
    for name in ("", "/", "a//b", "a/", "/1scan", "sc an", "a*", "**", "a$b", "é", "%"):
        assert not is_name(name), name
    assert full_name("/robot1", "scan") == "/robot1/scan"
    assert full_name("/", "scan") == "/scan"
    assert full_name("/robot1", "/tf") == "/tf"
    assert check_namespace("robot1/") == "/robot1"
    assert check_namespace("") == "/"
    with pytest.raises(ConfigError, match="is no namespace"):
        check_namespace("robot 1")
    with pytest.raises(ValueError, match="no type"):
        dds_type("LaserScan")


def test_whoever_declares_another_token_has_another_id():
    assert gid_of(TALKER_TOKEN) == gid_of(TALKER_TOKEN)
    assert gid_of(TALKER_TOKEN) != gid_of(NODE_TOKEN)
    assert len(gid_of(TALKER_TOKEN)) == 16


def test_a_service_answers_as_ros_reads_it():
    assert read_answer(encode_answer(Answer(True, "pressed"))) == (True, "pressed")
    assert read_answer(encode_answer(Answer(False, ""))) == (False, "")
