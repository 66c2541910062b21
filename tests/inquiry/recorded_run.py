"""A short run on a twin in this process, recorded as `lira record` would, for tests."""

from lira.hal.bus.attachment import Attachment
from lira.hal.bus.reader import RawSample
from lira.hal.bus.services import LOCKSTEP, Info
from lira.hal.bus.topics import APPLIED, CAMERA, DECISION, METHOD, SCAN
from lira.hal.messages.ros.codec import encode
from lira.tools.recording.layout import Head
from lira.tools.recording.timeline import TimeLine
from lira.tools.recording.writer import RecordingWriter

EPOCH = 5
SECOND_NS = 10**9


def head_of(profile):
    return Head("rosbot", "0.1.0", 100 * SECOND_NS, 100 * SECOND_NS, Info(profile, LOCKSTEP, EPOCH))


def write_reports(folder, profile, reports, *, skip=()):
    """Record decisions, calls and whatever else has a stamp; those of the numbers in `skip` are lost."""
    topics = {topic.kind: topic for topic in (DECISION, METHOD, APPLIED, SCAN, CAMERA)}
    line = TimeLine(100 * SECOND_NS, 0, lockstep=True)
    counts = dict.fromkeys(topics, 0)
    with RecordingWriter(folder, head_of(profile), split_bytes=2**30) as writer:
        for number, report in enumerate(reports):
            topic = topics[type(report)]
            sent = Attachment(EPOCH, counts[type(report)], round(report.stamp_s * 1e9))
            counts[type(report)] += 1
            if number in skip:
                continue
            sample = RawSample(topic.key, topic.ros_type, encode(report), sent.to_bytes(), 0.0)
            writer.add(sample, *line.times(0.0, sent), sent.seq)
    return folder
