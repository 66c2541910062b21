"""`lira view` beside a robot that drives: what a client of Foxglove's protocol gets, and that it can do nothing."""

import asyncio
import contextlib
import os
import resource
import socket
import threading
import time
import urllib.request

import aiohttp
import numpy as np
import pytest
from foxglove_client import PROTOCOL, connect
from prometheus_client.parser import text_string_to_metric_families
from web_bed import robot_that_drives, wait_until

from lira.hal.bus.bus import Bus
from lira.hal.bus.reader import RawSample
from lira.hal.bus.services import Info
from lira.hal.bus.topics import APPLIED, BATTERY, CAMERA, ODOM, PICTURE, SCAN, TF, TOPICS
from lira.hal.messages import BatteryState, CompressedImage, Odometry, Reason
from lira.hal.messages.ros.codec import encode
from lira.hal.profile import load_profile
from lira.tools.cli import main
from lira.tools.launch.processes import ChildProcess, free_port, lira_command
from lira.tools.launch.threads import in_thread
from lira.tools.recording.layout import Head
from lira.tools.recording.writer import RecordingWriter
from lira.tools.view.foxglove_viewer import BACKLOG, FoxgloveViewer
from lira.tools.view.played import open_recording
from lira.tools.view.source import LiveSource, PlayedSource, Sample
from lira.tools.view.stream import stream

PROFILE = load_profile("thesis-sim")
RATES = {"/scan": 10.0, "/odom": 20.0, "/cmd_vel/applied": 20.0}


@pytest.fixture(scope="module")
def beside(tmp_path_factory):
    """A robot that drives and `lira view` beside it: the bus, the process, and the ports of Foxglove and metrics."""
    folder = tmp_path_factory.mktemp("view")
    with robot_that_drives() as (name, endpoint, bus):
        port, metrics = free_port(), free_port()  # not sooner: the robot's own might be one of them
        words = ["--name", name, "--connect", endpoint, "--port", str(port), "--metrics", str(metrics)]
        with ChildProcess("lira view", lira_command("view", *words), folder / "view.log") as view:
            view.wait_ready("numbers for Prometheus", 30.0)
            yield bus, view, port, metrics


def with_clients(test):
    """Run a test's coroutine with an HTTP session."""

    async def inside():
        async with aiohttp.ClientSession() as session, asyncio.timeout(60):
            return await test(session)

    return asyncio.run(inside())


def test_a_client_decodes_what_the_robot_sends(beside):
    _, _, port, _ = beside

    async def look(session):
        client = await connect(session, port)
        assert set(client.channels) == {f"/{topic.key}" for topic in TOPICS}
        assert client.info["capabilities"] == []
        topics = ["/scan", "/odom", "/camera/color/image_raw/compressed", "/cmd_vel/applied", "/battery"]
        topics = [topic for topic in topics if topic != "/battery" or PROFILE.battery is not None]
        await client.subscribe(*topics)
        return await client.first_of_each(topics)

    shown = with_clients(look)
    scan, picture = shown["/scan"].message, shown["/camera/color/image_raw/compressed"].message
    assert len(scan.ranges) == PROFILE.lidar.beams
    assert scan.header.frame_id
    assert bytes(picture.data[:4]) in (b"\x89PNG", b"\xff\xd8\xff\xe0")
    assert shown["/cmd_vel/applied"].message.source in ("policy", "none")
    assert np.isfinite(shown["/odom"].message.twist.twist.linear.x)
    assert abs(shown["/odom"].time_ns - time.time_ns()) < 60e9


@pytest.mark.alone
def test_who_says_nonsense_or_wants_to_command_changes_nothing(beside):
    bus, view, port, _ = beside

    async def misbehave(session):
        client = await connect(session, port)
        nonsense = ["", "{", "[]", '{"op": "subscribe"}', '{"op": "nothing"}', "x" * 100_000, '{"op": ' * 5000]
        nonsense.append('{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 4294967295}]}')
        for words in nonsense:
            with contextlib.suppress(ConnectionError):
                await client.socket.send_str(words)
        client = await connect(session, port)
        await client.say(
            op="advertise", channels=[{"id": 1, "topic": "/cmd_vel", "encoding": "cdr", "schemaName": "x"}]
        )
        await client.say(op="setParameters", parameters=[{"name": "speed", "value": 9}])
        await client.say(op="subscribeConnectionGraph")
        for data in (b"", b"\x01", b"\x01\x01\0\0\0" + bytes(48), b"\x02" * 100, os.urandom(10_000)):
            with contextlib.suppress(ConnectionError):
                await client.socket.send_bytes(data)
        again = await connect(session, port)
        await again.subscribe("/odom")
        return await again.next()

    def raw():
        for data in (b"GET / HTTP/1.1\r\n\r\n", b"\0" * 4096, b"GET /" + b"x" * 100_000):
            with socket.create_connection(("127.0.0.1", port)) as line, contextlib.suppress(OSError):
                line.sendall(data)

    raw()
    assert with_clients(misbehave).topic == "/odom"
    assert view.status() is None
    assert is_driven_on_time(bus)


@pytest.mark.alone
def test_a_client_that_never_reads_costs_the_robot_and_the_others_nothing(beside):
    bus, view, port, _ = beside

    async def look(session):
        stuck = [await connect(session, port) for _ in range(3)]
        for each in stuck:
            await each.subscribe(*each.channels)
            each.socket._response.connection.transport.pause_reading()
        reader = await connect(session, port)
        await reader.subscribe(*RATES)
        counts = dict.fromkeys(RATES, 0)
        began_s = time.monotonic()
        while (duration_s := time.monotonic() - began_s) < 3.0:
            counts[(await reader.next()).topic] += 1
        return {topic: count / duration_s for topic, count in counts.items()}

    rates = with_clients(look)
    assert all(rates[topic] > 0.5 * rate for topic, rate in RATES.items()), rates
    assert view.status() is None
    assert is_driven_on_time(bus)


def is_driven_on_time(bus):
    """Whether the policy's commands still get to the wheels, none too old."""
    reader = bus.reader(APPLIED, depth=64)
    applied = []
    wait_until(lambda: applied.extend(each.message for each in reader.poll()) or len(applied) >= 10)
    return all(each.reason is Reason.OK and each.command_age_s < PROFILE.control.policy_timeout_s for each in applied)


def test_prometheus_reads_the_numbers(beside):
    _, _, _, port = beside

    def families():
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5) as answer:
            return {each.name: each.samples for each in text_string_to_metric_families(answer.read().decode())}

    def told():
        found = families()
        counts = {each.labels["topic"]: each.value for each in found["lira_messages"]}
        reasons = {each.labels["reason"]: each.value for each in found.get("lira_reason", [])}
        return (counts, reasons) if counts.get("scan", 0) > 3 and reasons else None

    counts, reasons = wait_until(told)
    assert not {CAMERA.key, TF.key} & counts.keys()
    assert sum(reasons.values()) == 1
    assert families()["lira_linear_metres_per_second"]


def test_a_port_that_is_taken_is_told(beside, capsys):
    _, _, port, metrics = beside
    words = ["view", "--name", "nobody", "--connect", f"127.0.0.1:{free_port()}"]
    assert main(words) == 2
    assert "cannot open the bus" in capsys.readouterr().err
    from lira.hal.bus.boundary import Boundary
    from lira.hal.errors import ConfigError
    from lira.tools.view.metrics import Metrics

    with pytest.raises(ConfigError, match="cannot listen"):
        FoxgloveViewer("x", TOPICS, port=port)
    with pytest.raises(ConfigError, match="cannot listen"):
        Metrics("127.0.0.1", metrics, Boundary())


@contextlib.contextmanager
def streaming(source, viewer):
    stop = threading.Event()
    with contextlib.closing(viewer), in_thread(lambda: stream(source, [viewer], stop), stop):
        yield


def test_a_topic_is_fetched_from_the_robot_only_while_somebody_looks():
    name, endpoint = f"look{os.getpid()}", f"127.0.0.1:{free_port()}"
    robot, viewer = Bus(name, listen=endpoint), FoxgloveViewer(name, TOPICS, port=0)
    watch = Bus(name, connect=endpoint, watch=True)
    camera, battery = robot.publisher(CAMERA), robot.publisher(BATTERY)
    battery.put(BatteryState(1.0, 12.0), 1.0)

    async def look(session):
        client = await connect(session, viewer.port)
        assert not camera.matching
        await client.subscribe("/camera/color/image_raw/compressed", "/battery")
        await asyncio.to_thread(wait_until, lambda: camera.matching)
        first = await client.first_of_each(["/battery"])
        late = await connect(session, viewer.port)  # somebody else is subscribed already
        await late.subscribe("/battery")
        second = await late.first_of_each(["/battery"])
        assert first["/battery"].message.voltage == second["/battery"].message.voltage == 12.0
        await client.socket.close()
        await late.socket.close()
        await asyncio.to_thread(wait_until, lambda: not camera.matching)
        battery.put(BatteryState(2.0, 11.0), 2.0)  # while nobody looks
        again = await connect(session, viewer.port)
        await again.subscribe("/battery")
        assert (await again.next()).message.voltage == 11.0

    try:
        with streaming(LiveSource(watch), viewer):
            with_clients(look)
    finally:
        watch.close()
        robot.close()


def test_a_recording_is_told_to_foxglove(tmp_path):
    began_ns, odom = 1_700_000_000_000_000_000, Odometry(1.0, 2.0, 0.0, 0.0, 0.1, 0.0)
    head = Head("r2", "0", began_ns, began_ns, Info(PROFILE, "realtime", 1), "test")
    writer = RecordingWriter(tmp_path / "recording", head, split_bytes=2**30)
    for number, payload in enumerate([encode(odom), b"nothing", encode(odom)]):
        at_ns = began_ns + number * 10_000_000
        writer.add(RawSample(ODOM.key, ODOM.ros_type, payload, None, 0.0), at_ns, at_ns)
    writer.close()
    robot, samples = open_recording(tmp_path)
    source = PlayedSource(samples)
    viewer = FoxgloveViewer(robot, source.topics, port=0)

    async def look(session):
        client = await connect(session, viewer.port)
        assert client.info["name"] == "lira r2"
        await client.subscribe("/odom")
        return [await client.next() for _ in range(2)]

    with streaming(source, viewer):
        shown = with_clients(look)
    assert [each.message.pose.pose.position.x for each in shown] == [2.0, 2.0]
    assert [each.time_ns - began_ns for each in shown] == [0, 20_000_000]


class Flood:
    """More pictures than any client takes."""

    topics = TOPICS
    ended = False

    def __init__(self):
        self.sent = 0
        picture = CompressedImage(0.0, b"\xff\xd8" + bytes(60_000))
        self._sample = Sample(CAMERA, picture, encode(picture), 1)

    def listen(self, keys):
        self._heard = CAMERA.key in keys

    def poll(self):
        if not self._heard:
            return []
        self.sent += 100
        return [self._sample] * 100


def test_what_waits_for_a_slow_client_is_bounded():
    viewer, source = FoxgloveViewer("x", [CAMERA, ODOM], port=0), Flood()

    async def look(session):
        client = await connect(session, viewer.port)
        await client.subscribe("/camera/color/image_raw/compressed")
        client.socket._response.connection.transport.pause_reading()
        before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        await asyncio.to_thread(wait_until, lambda: source.sent > 10_000)
        return (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb) / 1000

    with streaming(source, viewer):
        grown_mb = with_clients(look)
    assert grown_mb < 3 * BACKLOG * 0.06 + 20, f"{grown_mb:.0f} MB of {source.sent * 0.06:.0f} MB"


def test_only_pictures_are_heard_one_at_a_time():
    """What is large is kept once between two looks, what is small as often as it comes."""
    name, endpoint = f"deep{os.getpid()}", f"127.0.0.1:{free_port()}"
    robot = Bus(name, listen=endpoint)
    watch = Bus(name, connect=endpoint, watch=True)
    try:
        source = LiveSource(watch)
        source.listen({ODOM.key, CAMERA.key})
        odom, camera = robot.publisher(ODOM), robot.publisher(CAMERA)
        wait_until(lambda: odom.matching and camera.matching)
        heard: list[Sample] = []

        def put_and_poll():
            for number in range(5):
                odom.put(Odometry(1.0, float(number), 0.0, 0.0, 0.0, 0.0), 1.0)
                camera.put(CompressedImage(1.0, b"\xff\xd8\xff\xd9"), 1.0)
            time.sleep(0.05)
            heard[:] = source.poll()
            return [each.message.x_m for each in heard if each.topic == ODOM] == [0.0, 1.0, 2.0, 3.0, 4.0]

        wait_until(put_and_poll)
        assert len([each for each in heard if each.topic.qos == PICTURE]) == 1
        assert all(each.payload == encode(each.message) for each in heard)
    finally:
        watch.close()
        robot.close()


def test_the_protocol_is_spoken_to_those_who_speak_it(beside):
    _, _, port, _ = beside

    async def look(session):
        with pytest.raises(aiohttp.WSServerHandshakeError):
            await session.ws_connect(f"ws://127.0.0.1:{port}", protocols=["something.else"])
        socket_ = await session.ws_connect(f"ws://127.0.0.1:{port}", protocols=[PROTOCOL])
        assert socket_.protocol == PROTOCOL
        return SCAN.key

    assert with_clients(look) == "scan"
