"""Whether a test presses or pulls, by the words laboratories have for it: in names, above a table, in its rows."""

from collections.abc import Iterator, Mapping, Sequence

from rig.intake.roles import words_of

PRESSES, PULLS = "compression", "tension"
WORDS = {
    PRESSES: (
        "compression", "compressive", "compress", "compressed", "druck", "druckkraft", "druckversuch", "druckprüfung",
        "stauchung", "push", "pushing", "compresión", "compressione", "压缩", "圧縮", "압축",
    ),
    PULLS: (
        "tension", "tensile", "zug", "zugkraft", "zugversuch", "zugprüfung", "pull", "pulling", "traction", "tracción",
        "trazione", "拉伸", "引張", "인장",
    ),
}  # fmt: skip
# Of the words of a value above a table: a longer one is a note, in which such a word may stand for anything.
MOST_WORDS = 4


def kinds_in(text: str) -> set[str]:
    """Which of the two the text names."""
    said = set(words_of(text))
    return {
        kind
        for kind, known in WORDS.items()
        if any(word in said or (not word.isascii() and word in text.lower()) for word in known)
    }


def said_of_test(places: Sequence[str], facts: Mapping[str, str]) -> dict[str, str]:
    """By what is done in a test the text that says so: names of its file and sheet, values above the table."""
    values = [value for value in facts.values() if not any(map(str.isdigit, value))]
    short = [value for value in values if len(words_of(value)) <= MOST_WORDS]
    return {kind: text for text in (*places, *short)[::-1] for kind in kinds_in(text)}


def mentions(facts: Mapping[str, str]) -> Iterator[str]:
    """What stands above the table that names pulling and says nothing of pressing, as limits and notes do."""
    found = {name: kinds_in(f"{name} {value}") for name, value in facts.items()}
    if PRESSES not in set().union(*found.values()):
        yield from (name for name, kinds in found.items() if kinds)


def said_in_rows(texts: Sequence[str]) -> dict[str, str]:
    """What the texts of a column say, by what is done; nothing where one of them says neither, or both."""
    known = {text: kinds_in(text) for text in set(texts) if text}
    alike = all(len(kinds) == 1 for kinds in known.values())
    return {next(iter(own)): text for text, own in known.items()} if alike else {}
