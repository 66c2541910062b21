"""One voice: who drives, why, and what the person does now. Every screen, the pad and the terminal say this alone."""

import tomllib
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import msgspec

from lira.hal.errors import ConfigError
from lira.hal.messages import Applied, Reason, SessionState, Source
from lira.hal.words import plural
from lira.tools.operator.situation import URGENCY, Situation, Urgency, lost_devices, situation_of, standing_of
from lira.tools.operator.view import View

ENGLISH = "en"
OBEYED = Source.POLICY, Reason.OK
VERDICT_S = 10.0  # so long what became of a request is news


class Words(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One situation in words: who drives, why, and what to do now."""

    who: str
    why: str
    now: str


@dataclass(frozen=True, slots=True)
class Voice:
    """What is said now, and how loud."""

    situation: Situation
    urgency: Urgency
    who: str
    why: str
    now: str


def speak(view: View, language: str = ENGLISH) -> Voice:
    """Say what is so and what to do. Raises `ConfigError` for a language that there is none of."""
    situation = situation_of(view)
    words = vocabulary(language)[situation]
    facts = _facts(view)
    why = words.why.format_map(facts)
    if view.applied is not None and view.applied.commander and view.linked:
        why = f"{view.applied.commander}: {why}"
    return Voice(situation, URGENCY[situation], words.who.format_map(facts), why, words.now.format_map(facts))


def explain(applied: Applied, wheels: Applied | None = None) -> str:
    """Why the robot stands, and what to do, in one line for a terminal.

    `applied` is what became of a command from here. `wheels` is what they got last, from whomever, if that is known.
    """
    if applied.reason is Reason.REFUSED and wheels is not None and (wheels.source, wheels.reason) == OBEYED:
        voice = speak(View("", applied=wheels, link_age_s=0.0, other=True))
        return f"{voice.who}: {voice.why} {voice.now}"
    situation = standing_of(replace(applied, source=Source.NONE)) or Situation.TOLD_TO_STAND
    words, facts = vocabulary(ENGLISH)[situation], _facts(View("", applied=applied))
    return f"{words.who}: {words.why.format_map(facts)} {words.now}"


def verdict(view: View) -> tuple[str, bool | None]:
    """What became of the newest request in a few words, and whether it was done; None if there is nothing to tell."""
    if view.unanswered is not None:
        return f"nobody answers to '{view.unanswered}': does lira fusion run?", False
    if view.answering is None:
        return "nobody takes requests: start lira fusion" if view.linked else "", None
    if not view.answering.count or view.verdict_age_s > VERDICT_S:
        return "", None
    return view.answering.words, view.answering.accepted


def progress_words(session: SessionState) -> str:
    """How a session of teaching goes, in a line."""
    parts = [
        f"{session.person}: lap {session.laps}, {session.passed} passed",
        f"hit {session.collisions}, lost {session.lost}",
        f"{session.alone:.0%} without you",
        f"calls answered: {session.answered} of {session.calls}",
        f"{plural(session.labels, 'label')} of yours",
    ]
    if session.shown:
        parts.append(f"alone: {session.proven} of {session.shown}")
    return "; ".join(parts)


def _facts(view: View) -> dict[str, str]:
    """What the words may name."""
    decision = view.deciding
    heard = view.link_age_s < float("inf")
    return {
        "expert": "" if decision is None else decision.driver.upper(),
        "age": f" for {view.link_age_s:.0f} s" if heard else "",
        "verdict": "" if view.teaching is None else view.teaching.words,
        "proven": "" if view.teaching is None else str(view.teaching.proven),
        "shown": "" if view.teaching is None else str(view.teaching.shown),
        "lost": "" if view.applied is None else ", ".join(lost_devices(view.applied)),
    }


def languages() -> list[str]:
    """What it can be said in."""
    return sorted(path.name.removesuffix(".toml") for path in _folder().iterdir() if path.name.endswith(".toml"))


@cache
def vocabulary(language: str) -> dict[Situation, Words]:
    """Every situation's words. Raises `ConfigError` if the language is not there or its file lacks a situation."""
    if language not in languages():
        raise ConfigError(f"there are no words in '{language}'", f"Choose one of: {', '.join(languages())}.")
    tables = tomllib.loads(_folder().joinpath(f"{language}.toml").read_text(encoding="utf-8"))
    try:
        return msgspec.convert(tables, dict[Situation, Words])
    except msgspec.ValidationError as error:
        raise ConfigError(f"the words in '{language}' are not whole: {error}", "Compare with en.toml.") from error


def _folder() -> Path:
    return Path(__file__).parent / "words"
