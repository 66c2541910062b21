"""A bare zenoh echo as a process: `python -m lira.tools.bench.parts.echo HOST:PORT`. No code of ours is in its way."""

import contextlib
import sys

import zenoh

READY = "echo listens"
QUESTION, ANSWER = "echo/question", "echo/answer"


def session(role: str, endpoint: str) -> zenoh.Session:
    """Open a session over the same two links as the bus; `role` is "listen" or "connect"."""
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("transport/unicast/max_links", "2")
    config.insert_json5(f"{role}/endpoints", f'["tcp/{endpoint}?rel=1", "udp/{endpoint}?rel=0"]')
    if role == "connect":
        config.insert_json5("listen/endpoints", "[]")
    return zenoh.open(config)


def publisher(bare: zenoh.Session, key: str) -> zenoh.Publisher:
    """Declare a publisher with the qualities of a command."""
    return bare.declare_publisher(
        key, reliability=zenoh.Reliability.BEST_EFFORT, priority=zenoh.Priority.REAL_TIME, express=True
    )


def main(endpoint: str) -> None:
    """Answer until the process is stopped."""
    with session("listen", endpoint) as bare:
        answers = publisher(bare, ANSWER)
        questions = bare.declare_subscriber(QUESTION)
        print(READY, flush=True)
        for sample in questions:
            answers.put(sample.payload, attachment=sample.attachment)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        main(sys.argv[1])
