"""Numbers for Prometheus: what came, how old it is, why the robot moves or stands, who drives, how learning goes."""

import threading
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from lira.hal.bus.boundary import Boundary
from lira.hal.bus.topics import (
    APPLIED,
    BATTERY,
    CAMERA_INFO,
    DECISION,
    DEPTH_INFO,
    DIAGNOSTICS,
    METHOD,
    ODOM,
    PICTURE,
    SESSION,
    TF,
    TOPICS,
)
from lira.hal.errors import ConfigError
from lira.hal.messages import Applied, Call, Decision, DiagnosticArray, Odometry, Reason, SessionState, Source, Stage
from lira.tools.view.source import Sample

MOST_PARTS = 64  # of a process that reports on itself
# What is large, or sent only to those who listen, is not counted here: it would be fetched for nothing else.
ON_DEMAND = (TF, CAMERA_INFO, DEPTH_INFO, METHOD)
COUNTED = tuple(topic.key for topic in TOPICS if topic.qos != PICTURE and topic not in ON_DEMAND)


@dataclass(frozen=True, slots=True)
class Heard:
    """What is known of one topic: how many messages came, the newest, and when that came (monotonic)."""

    count: int
    newest: Sample
    at_s: float


class Metrics:
    """Serves the numbers over HTTP until closed. Raises `ConfigError` if the address cannot be had."""

    def __init__(self, host: str, port: int, boundary: Boundary) -> None:
        self._board = Board(boundary)
        registry = CollectorRegistry()
        registry.register(self._board)
        try:
            self._server, self._thread = start_http_server(port, host, registry)
        except OSError as error:
            raise ConfigError(
                f"cannot listen on {host}:{port}: {error.strerror}", "Is another one running? Choose --metrics."
            ) from error

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self._server.server_port)

    def wanted(self) -> Collection[str]:
        """Everything that the robot tells anyway."""
        return COUNTED

    def show(self, samples: Sequence[Sample]) -> None:
        """Count samples, and keep the newest."""
        self._board.note(samples, time.monotonic())

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class Board(Collector):
    """Keeps the newest of each topic; read by the threads that answer Prometheus."""

    def __init__(self, boundary: Boundary) -> None:
        self._boundary = boundary
        self._lock = threading.Lock()
        self._heard: dict[str, Heard] = {}
        self._parts: dict[str, int] = {}

    def note(self, samples: Sequence[Sample], now_s: float) -> None:
        """Take in samples that came at `now_s`, monotonic."""
        with self._lock:
            for sample in samples:
                before = self._heard.get(sample.topic.key)
                self._heard[sample.topic.key] = Heard(1 + (before.count if before else 0), sample, now_s)
                if sample.topic.key == DIAGNOSTICS.key:
                    self._note_parts(sample.message)

    def collect(self) -> Iterator[Metric]:
        """Yield the numbers as they are now."""
        with self._lock:
            heard, parts = dict(self._heard), dict(self._parts)
        yield from families(heard, parts, self._boundary.counts, time.monotonic())

    def _note_parts(self, report: DiagnosticArray) -> None:
        for status in report.status:
            if status.name in self._parts or len(self._parts) < MOST_PARTS:
                self._parts[status.name] = status.level


def families(
    heard: Mapping[str, Heard], parts: Mapping[str, int], refused: Mapping[tuple[str, str], int], now_s: float
) -> Iterator[Metric]:
    """Yield what is known at `now_s` as Prometheus has it. Pure; what was never heard is left out."""
    messages = CounterMetricFamily("lira_messages", "Messages heard.", labels=["topic"])
    age = GaugeMetricFamily("lira_message_age_seconds", "Since the newest message was heard.", labels=["topic"])
    for key, each in heard.items():
        messages.add_metric([key], each.count)
        age.add_metric([key], now_s - each.at_s)
    yield from (messages, age)
    yield _labelled("lira_refused_messages", "Messages that this viewer did not take.", ("topic", "reason"), refused)
    yield _gauges("lira_diagnostic_level", "0 ok, 1 warning, 2 error, 3 stale.", "part", parts)
    newest = {key: each.newest.message for key, each in heard.items()}
    if ODOM.key in newest:
        yield from _motion(newest[ODOM.key])
    if APPLIED.key in newest:
        yield from _governor(newest[APPLIED.key])
    if DECISION.key in newest:
        yield from _decision(newest[DECISION.key])
    if SESSION.key in newest:
        yield from _session(newest[SESSION.key])
    if BATTERY.key in newest:
        yield GaugeMetricFamily("lira_battery_volts", "Battery.", newest[BATTERY.key].voltage_v)


def _motion(odom: Odometry) -> Iterator[Metric]:
    yield GaugeMetricFamily("lira_linear_metres_per_second", "Forward speed by odometry.", odom.linear_m_s)
    yield GaugeMetricFamily("lira_angular_radians_per_second", "Turn rate by odometry.", odom.angular_rad_s)


def _governor(applied: Applied) -> Iterator[Metric]:
    yield _one_of("lira_commander", "Whose command the wheels get.", "source", Source, applied.source)
    yield _one_of("lira_reason", "Why the wheels get what they get.", "reason", Reason, applied.reason)
    yield GaugeMetricFamily("lira_command_age_seconds", "Of the command that is applied.", applied.command_age_s)


def _decision(decision: Decision) -> Iterator[Metric]:
    yield _gauges("lira_driver", "Who drives this step.", "driver", {decision.driver: 1})
    yield _one_of("lira_call", "How the person is called.", "call", Call, decision.call)
    experts = {expert.name: expert.activation for expert in decision.experts}
    yield _gauges("lira_activation", "Activation of an expert (eq. 1).", "expert", experts)
    yield GaugeMetricFamily("lira_activation_threshold", "An expert is active from here.", decision.threshold)
    counts = decision.labels
    labels = {
        ("human", "given"): counts.given_human,
        ("human", "stored"): counts.stored_human,
        ("expert", "given"): counts.given_expert,
        ("expert", "stored"): counts.stored_expert,
    }
    yield _labelled("lira_labels", "Labels by source, before and after the filter.", ("source", "kept"), labels)
    yield CounterMetricFamily("lira_training_steps", "Training steps.", decision.training_steps)
    yield CounterMetricFamily("lira_interventions", "Interventions.", decision.interventions)
    yield CounterMetricFamily("lira_calls", "Calls of the person.", decision.calls)


def _session(session: SessionState) -> Iterator[Metric]:
    yield _one_of("lira_session_stage", "What the session is at.", "stage", Stage, session.stage)
    yield GaugeMetricFamily("lira_alone_ratio", "Steps in which no person drove.", session.alone)


def _one_of(name: str, words: str, label: str, kinds: type[StrEnum], now: StrEnum) -> Metric:
    """One line for each value that there may be, 1 for the one that is."""
    return _gauges(name, words, label, {kind.value: int(kind == now) for kind in kinds})


def _gauges(name: str, words: str, label: str, values: Mapping[str, float]) -> Metric:
    metric = GaugeMetricFamily(name, words, labels=[label])
    for key, value in values.items():
        metric.add_metric([key], value)
    return metric


def _labelled(name: str, words: str, labels: tuple[str, str], values: Mapping[tuple[str, str], int]) -> Metric:
    metric = CounterMetricFamily(name, words, labels=labels)
    for key, value in values.items():
        metric.add_metric(list(key), value)
    return metric
