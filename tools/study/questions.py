"""What is asked after a block: the NASA task load index (Hart and Staveland 1988), unweighted, and free questions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

SCALES = {
    "mental": "How much mental activity was required? 0 low, 100 high",
    "physical": "How much physical activity was required? 0 low, 100 high",
    "temporal": "How much time pressure did you feel? 0 low, 100 high",
    "performance": "How successful were you? 0 perfect, 100 failure",
    "effort": "How hard did you have to work? 0 low, 100 high",
    "frustration": "How insecure, discouraged or annoyed were you? 0 low, 100 high",
}
Ask = Callable[[str], str]


@dataclass(frozen=True, slots=True)
class Answered:
    """`load` are the six scales in [0, 100], by name; `words` the free answers, by question."""

    load: Mapping[str, int]
    words: Mapping[str, str]

    @property
    def total(self) -> float:
        """The raw index: the mean of the scales."""
        return sum(self.load.values()) / len(self.load)


def ask_all(questions: Sequence[str], ask: Ask) -> Answered:
    """Ask everything; a number that is none is asked for again."""
    return Answered({name: _number(words, ask) for name, words in SCALES.items()}, {q: ask(q) for q in questions})


def _number(words: str, ask: Ask) -> int:
    while True:
        text = ask(words).strip()
        if text.isdecimal() and int(text) <= 100:
            return int(text)
