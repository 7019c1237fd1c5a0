"""What a record is asked, whatever made its session."""

from collections.abc import Callable, Iterator

from benchmarks.campaigns.case import Record
from benchmarks.campaigns.counts import Question
from benchmarks.campaigns.naive import METHODS

JUDGED_GOOD = ("adequate", "explained")
# An error up to this many times the known noise may be called noise: the limit that docs/explanation/criticism.md
# gives the verdict has no room for more.
MOST_NOISE = 1.25


def has_false_name(one: Record) -> Iterator[bool]:
    """A certain finding in whose set nothing is true."""
    yield bool(one.false_names)


def has_false_hint(one: Record) -> Iterator[bool]:
    """A provisional finding in whose set nothing is true."""
    yield bool(one.false_hints)


def finds(one: Record) -> Iterator[bool]:
    """Of sessions that hide what the library names: whether anything is named."""
    if one.truth.names:
        yield bool(one.answer.named)


def holds_truth(one: Record) -> Iterator[bool]:
    """Of those in which anything was: whether something true is in a set."""
    if one.truth.names and one.answer.named:
        yield bool(one.truth.all_names & one.answer.all_names)


def holds_each(one: Record) -> Iterator[bool]:
    """Each thing hidden that the library names, where anything was named."""
    if one.answer.named:
        yield from (bool(names & one.answer.all_names) for names in one.truth.names)


def flags_outside(one: Record) -> Iterator[bool]:
    """Of what the library has no name for: whether the verdict says that something is left."""
    if one.truth.outside:
        yield one.answer.verdict == "unexplained"


def flags_variable(one: Record) -> Iterator[bool]:
    """Of what depends on a known variable: whether that is said."""
    if one.truth.depends:
        yield bool(one.truth.depends & set(one.answer.depends))


def names_in_clean(one: Record) -> Iterator[bool]:
    """Of sessions that hide nothing: whether anything certain is named."""
    if one.truth.is_clean:
        yield any(found.is_certain for found in one.answer.named)


def is_adequate_when_clean(one: Record) -> Iterator[bool]:
    """Of the same: whether they are called adequate."""
    if one.truth.is_clean:
        yield one.answer.verdict == "adequate"


def covers(one: Record) -> Iterator[bool]:
    """Each known size of a cause that is first in its set: whether it lies in the interval."""
    for found in one.answer.named:
        if found.effects[0] in one.truth.all_names:
            for name, true in one.truth.sizes.items():
                if name in found.sizes:
                    _, low, high = found.sizes[name]
                    yield low <= true <= high


def leaves_noise_only(one: Record) -> Iterator[bool]:
    """Of adequate and explained: whether the error left is no more than the known noise."""
    answer = one.answer
    if answer.verdict in JUDGED_GOOD and answer.left_N is not None and answer.noise_N is not None:
        yield answer.left_N <= MOST_NOISE * answer.noise_N


def naive_questions() -> tuple[Question, ...]:
    """For comparison: sessions in which a naive method names anything false; in clean ones that is anything at all."""
    asked = ((clean, told, name) for name in METHODS for clean, told in ((True, "clean"), (False, "other")))
    return tuple(
        Question(f"{told} sessions in which {name} names falsely", None, _by(name, clean))
        for clean, told, name in asked
    )


def _by(method: str, clean: bool) -> Callable[[Record], Iterator[bool]]:
    def ask(one: Record) -> Iterator[bool]:
        if one.truth.is_clean is clean and method in one.answer.naive:
            yield bool(set(one.answer.naive[method]) - one.truth.all_names)

    return ask
