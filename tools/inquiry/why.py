"""Why a robot did what it did at a moment: who drove, what everybody proposed, what decided, what the wheels got."""

from collections.abc import Iterator
from typing import Any

import msgspec

from lira.hal.bus.topics import APPLIED, CAMERA, DECISION, ODOM, SCAN, SIM_STATE
from lira.hal.messages import Applied, Call, CourseState, Decision, Driver, Odometry, Reason, Twist, is_neutral
from lira.hal.words import plural
from lira.tools.inquiry.algorithm import activity, line_of, settings_of, spoken
from lira.tools.inquiry.moment import Moment
from lira.tools.inquiry.trace import Step
from lira.tools.operator.voice import explain, speak
from lira.tools.output.lap_names import PHASES

WIDTH = 9


def words(moment: Moment) -> list[str]:
    """Everything, to read."""
    voice = speak(moment.view)
    lines = [f"{_place(moment)}", f"{voice.who}: {voice.why}", ""]
    if moment.step is not None and moment.step.decided is not None:
        lines += _decided(moment, moment.step)
    elif moment.message(DECISION) is not None:
        lines += _only_decision(moment.message(DECISION))
    else:
        lines.append("nobody decides")
    lines.append("")
    lines += _line("wheels", _wheels(moment))
    lines += _line("senses", _senses(moment))
    return lines


def plain(moment: Moment) -> dict[str, Any]:
    """The same for a machine."""
    voice, step = speak(moment.view), moment.step
    applied: Applied | None = moment.message(APPLIED)
    found: dict[str, Any] = {
        "time_s": moment.time_s,
        "robot_time_s": moment.at_s,
        "situation": str(voice.situation),
        "who": voice.who,
        "why": voice.why,
        "decision": _plain(moment.message(DECISION)),
        "applied": _plain(applied),
        "novice": _plain(moment.novice),
        "method": None if moment.recipe is None else moment.recipe.preset.name,
    }
    if step is not None and step.decided is not None:
        line = line_of(step, moment.recipe, moment.novice)
        found |= {
            "proposed": _plain(step.decided),
            "learned": _plain(step.learned),
            "human": step.human,
            "lines": line.lines,
            "because": line.words,
        }
    return found


def _plain(value: Any) -> Any:
    return msgspec.to_builtins(value)


def _place(moment: Moment) -> str:
    decision: Decision | None = moment.message(DECISION)
    place = "" if decision is None else f", {PHASES[decision.phase]} {decision.lap}"
    method = "" if moment.recipe is None else f", method '{moment.recipe.preset.name}'"
    return f"{'now' if moment.live else f'at {moment.time_s:.1f} s'}{place}{method}"


def _line(name: str, text: Iterator[str]) -> list[str]:
    return [f"{name if not number else '':<{WIDTH}} {each}" for number, each in enumerate(text)]


def _decided(moment: Moment, step: Step) -> list[str]:
    assert step.decided is not None
    decided, settings = step.decided, settings_of(moment.recipe)
    line = line_of(step, moment.recipe, moment.novice)
    names = f"lines {line.lines} of Algorithm 1: " if line.lines else ""
    lines = _line("because", iter([f"{names}{line.words}"]))
    lines += _line("drove", _drove(step))
    for expert in decided.experts:
        why = activity(expert, decided.threshold, settings)
        lines += _line(expert.name, iter([f"{spoken(expert.action)}   {why}"]))
    known = (
        ""
        if moment.novice is None
        else f"   {plural(moment.novice.labels, 'label')} learned, {plural(moment.novice.steps, 'training step')}"
    )
    lines += _line("novice", iter([f"{spoken(decided.novice)}{known}"]))
    lines += _line("human", iter([spoken(step.human) if step.human else _absent(step)]))
    lines += _line("call", iter([_call(decided.choice.call)]))
    lines += _line("learned", _learned(step))
    return lines


def _only_decision(decision: Decision) -> list[str]:
    """What a decision tells where nobody told of the method's calls."""
    lines = _line("drove", iter([f"{_who(decision.driver)}: {spoken(decision.executed)}"]))
    for expert in decision.experts:
        lines += _line(expert.name, iter([f"{spoken(expert.action)}   {activity(expert, decision.threshold, None)}"]))
    lines += _line("novice", iter([spoken(decision.novice)]))
    return lines + _line("call", iter([_call(decision.call)]))


def _drove(step: Step) -> Iterator[str]:
    assert step.decided is not None
    choice = step.decided.choice if step.learned is None else step.learned.choice
    slow = f", at {step.decided.speed:g} of its speed" if step.decided.speed != 1.0 and step.human is None else ""
    yield f"{_who(choice.driver)}: {spoken(choice.action)}{slow}"
    if step.human is not None:
        proposed = step.decided.choice
        yield f"proposed was {_who(proposed.driver)}: {spoken(proposed.action)}"
    if step.chosen:
        yield f"from the next step on the person has {step.chosen} drive"


def _who(driver: str) -> str:
    return {
        Driver.HUMAN: "the human",
        Driver.NOVICE: "the novice",
        Driver.MEAN: "the mean of the experts",
        Driver.SHIELD: "the shield",
        Driver.NOBODY: "nobody",
    }.get(Driver(driver) if driver in tuple(Driver) else None, f"the {driver} expert")  # type: ignore[arg-type]


def _absent(step: Step) -> str:
    return "does not drive" if not step.chosen else f"chose {step.chosen}"


def _call(call: Call) -> str:
    return {Call.NONE: "none", Call.ATTENTION: "attention: look", Call.FEEDBACK: "feedback: answer"}[call]


def _learned(step: Step) -> Iterator[str]:
    learned = step.learned
    if learned is None:
        yield "nothing: the robot was held"
        return
    choice = learned.choice
    if choice.label is None:
        yield "nothing"
    elif learned.reserved:
        yield f"reserved: {spoken(choice.label)} counts unless the human objects within a second"
    elif learned.stored:
        yield f"{spoken(choice.label)}, from {_who(choice.driver)}"
    else:
        yield f"not {spoken(choice.label)}: the novice does that already"
    if learned.settled:
        yield f"of earlier labels {sum(learned.settled)} were learned, and {learned.settled.count(False)} dropped"


def _wheels(moment: Moment) -> Iterator[str]:
    applied: Applied | None = moment.message(APPLIED)
    if applied is None:
        yield "nothing is known of what they got"
        return
    yield from _applied(applied)
    if moment.result is not None and moment.result.sent_s > moment.at_s:
        later_s = moment.result.sent_s - moment.at_s
        first, *rest = _applied(moment.result.message)
        yield f"this decision reached them {later_s:.2f} s later: {first}"
        yield from rest
    if is_neutral(applied.twist):
        yield from _stands(moment, applied)


def _applied(applied: Applied) -> Iterator[str]:
    clamps = f"; cut by {', '.join(applied.clamps)}" if applied.clamps else ""
    yield f"{_twist(applied.twist)} from {applied.source}: {applied.reason}{clamps}"
    if applied.seq >= 0:
        answers = f", answers observation {applied.answers}" if applied.answers >= 0 else ""
        yield f"by command {applied.seq} of its sender, {applied.command_age_s:.2f} s old{answers}"


def _stands(moment: Moment, applied: Applied) -> Iterator[str]:
    """Why they stand, and what they did before."""
    yield explain(applied) if applied.reason is not Reason.OK else "who drives wants it to stand"
    if moment.moved is not None:
        last: Applied = moment.moved.message
        since_s = moment.at_s - moment.moved.sent_s
        yield f"{since_s:.1f} s before they had {_twist(last.twist)} from {last.source}"


def _twist(twist: Twist) -> str:
    return f"{twist.linear_m_s:+.2f} m/s, {twist.angular_rad_s:+.2f} rad/s"


def _senses(moment: Moment) -> Iterator[str]:
    seen = [(name, topic) for name, topic in (("scan", SCAN), ("picture", CAMERA)) if topic.key in moment.newest]
    parts = [f"{name} {moment.age_s(topic):.2f} s old" for name, topic in seen]
    yield ", ".join(parts) or "nothing"
    odom: Odometry | None = moment.message(ODOM)
    if odom is not None:
        speed = f"{odom.linear_m_s:+.2f} m/s, {odom.angular_rad_s:+.2f} rad/s"
        yield f"odometry: x {odom.x_m:.2f} m, y {odom.y_m:.2f} m, {speed}"
    truth: CourseState | None = moment.message(SIM_STATE)
    if truth is not None:
        yield (
            f"truth: {truth.progress_m:.1f} m along the course, {truth.lateral_m:+.2f} m beside it, "
            f"{truth.clearance_m:.2f} m to the nearest obstacle{', collided' if truth.collided else ''}"
        )
