"""What a recording, a specimen, a site and a cycle are called: by the parts of file names that vary."""

import re
from collections.abc import Sequence
from itertools import takewhile
from typing import NamedTuple

from rig.config.table import TomlTable
from rig.intake.pattern import matched

# What laboratories call a part of a name, or a column, by the key of the mapping it belongs to.
KINDS = {
    "specimen": (
        "specimen", "sample", "probe", "subject", "patient", "participant", "animal", "sub", "subj", "pat", "muster",
        "试样", "試験片", "échantillon", "prüfkörper", "éprouvette", "provino", "probeta",
    ),
    "site": ("site", "well", "position", "point", "location", "loc", "spot", "phalanx", "finger", "pos", "stelle"),
    "cycle": ("cycle", "trial", "rep", "repeat", "repetition", "run", "test", "versuch", "cyc", "zyklus", "take"),
}  # fmt: skip
OPERATORS = ("operator", "examiner", "bediener", "prüfer")
TITLED = frozenset((*KINDS["specimen"], *KINDS["site"], *OPERATORS))
# One file of seven that a program has named False, or blank, leaves the others numbered.
NUMBERED = 0.75
_WORD = re.compile(r"(?P<word>[^\W\d_]+)(?P<value>\d[\w.]*)")
_SIGNS = re.compile(r"([_\-/ ]+)")


class Names(NamedTuple):
    """A pattern for files, without what ends their names, and the templates over its places."""

    files: str
    templates: TomlTable


def names_of(stems: Sequence[str], others: Sequence[str] = ()) -> Names | None:
    """A pattern with a place for each part of ``stems`` that varies, for none of ``others``; None if unlike."""
    found = _pattern(stems)
    if found is None and all(stem.count("/") == 1 for stem in stems):
        inner = _pattern([stem.rpartition("/")[2] for stem in stems])
        found = inner and ("{folder}/" + inner[0], inner[1])
    if found is None or any(matched(found[0], stem) is None for stem in stems):
        return None
    pattern = _narrow(found[0], stems) if _any_matched(found[0], others) else found[0]
    return None if _any_matched(pattern, others) else Names(pattern, _with_specimen(*found))


def _with_specimen(pattern: str, names: Sequence[str]) -> TomlTable:
    """The templates; what a folder holds several sites of is a specimen, whatever the folder is called."""
    found, folder = templates_of(names), pattern.rpartition("/")[0].rpartition("/")[2]
    if "{" not in folder or found.get("site", folder) in folder or "specimen" in found:
        return found
    return {"specimen": folder, **{key: template for key, template in found.items() if template not in folder}}


def _any_matched(pattern: str, stems: Sequence[str]) -> bool:
    return any(matched(pattern, stem) is not None for stem in stems)


def _narrow(pattern: str, stems: Sequence[str]) -> str:
    """With the letters and digits that stand in each place, where all that stand there are equally long."""
    found = [labels for labels in (matched(pattern, stem) for stem in stems) if labels is not None]
    for name in found[0]:
        values = [labels[name] for labels in found]
        if len(set(map(len, values))) == 1 and "".join(values).isalnum():
            letters = (sorted(set(column)) for column in zip(*values, strict=True))
            shell = "".join(own[0] if len(own) == 1 else f"[{''.join(own)}]" for own in letters)
            pattern = pattern.replace(f"{{{name}}}", f"{{{name}:{shell}}}")
    return pattern


def templates_of(names: Sequence[str]) -> TomlTable:
    """Which of the names is the specimen, the site and the cycle, where it says so."""
    said = {kind: [name for name in names if name.lower() in words] for kind, words in KINDS.items()}
    return {kind: f"{{{found[0]}}}" for kind, found in said.items() if found}


def _pattern(stems: Sequence[str]) -> tuple[str, list[str]] | None:
    """The pattern and the names in it."""
    parted = [_SIGNS.split(stem) for stem in stems]
    if len(set(stems)) < 2 or len({len(parts) for parts in parted}) > 1:
        return None
    columns = list(zip(*parted, strict=True))
    if any(len(set(column)) > 1 for column in columns[1::2]):
        return None
    called = dict[int, str]()
    for at in range(0, len(columns), 2):
        if len(set(columns[at])) > 1:
            called[at] = _called(columns, at, list(called.values()))
    pieces = [f"{_shared(own)}{{{called[at]}}}" if at in called else own[0] for at, own in enumerate(columns)]
    return "".join(pieces), list(called.values())


def _called(columns: Sequence[Sequence[str]], at: int, taken: Sequence[str]) -> str:
    """By the word in front of its numbers, the word before it, or that it is a folder; else by its place."""
    numbered = sum(any(map(str.isdigit, part)) for part in columns[at]) >= NUMBERED * len(columns[at])
    before = columns[at - 2][0] if numbered and at > 1 and len(set(columns[at - 2])) == 1 else ""
    folder = "folder" if at + 1 < len(columns) and "/" in columns[at + 1][0] else ""
    name = (_shared(columns[at]) or (before if before.isalpha() else folder)).lower()
    return name if name.isidentifier() and len(name) > 1 and name not in taken else f"part_{at // 2 + 1}"


def _shared(column: Sequence[str]) -> str:
    """The word before the number in all of them, empty where they differ."""
    found = {match["word"] if match else "" for match in map(_WORD.fullmatch, column)}
    return found.pop() if len(found) == 1 else ""


def channels_of(first: Sequence[str], second: Sequence[str]) -> tuple[str, str, str] | None:
    """Patterns of two kinds of files that belong together two by two, and what their recording is called."""
    if set(first) == set(second) and "/" not in "".join(first):  # whose endings differ
        return ("{recording}",) * 3
    ours, theirs = (sorted(names, key=lambda name: (len(name), name)) for names in (first, second))
    before = _shared_start(ours[0], theirs[0])
    after = _shared_start(ours[0][len(before) :][::-1], theirs[0][len(before) :][::-1])[::-1]
    middles = [name[len(before) : len(name) - len(after)] for name in (ours[0], theirs[0])]
    head, tail = re.sub(r"[\W_]+$", "", before), re.sub(r"^[\W_]+", "", after)
    left, right = before[len(head) :], after[: len(after) - len(tail)]
    template = "-".join(f"{{{name}}}" for name, part in (("recording", head), ("more", tail)) if part)
    # Of names of which one is the other and more, the shorter ends otherwise.
    ends = ["" if own or tail else f":*[!{other[-1:]}]" for own, other in zip(middles, middles[::-1], strict=True)]
    heads = [f"{{recording{end}}}" if head else "" for end in ends]
    more = "{more}" if tail else ""
    patterns = [f"{own}{left}{middle}{right}{more}" for own, middle in zip(heads, middles, strict=True)]
    found = [[matched(pattern, one) for one in names] for pattern, names in zip(patterns, (ours, theirs), strict=True)]
    keys = [{tuple(labels.values()) for labels in group if labels is not None} for group in found]
    unlike = any(labels is None for group in found for labels in group) or keys[0] != keys[1]
    if unlike or not (all(middles) or any(ends)):
        return None
    return patterns[0], patterns[1], template or "{folder}"


def _shared_start(one: str, other: str) -> str:
    """What both begin with, without letters at its end, which may be the beginning of two words by chance."""
    pairs = takewhile(lambda pair: pair[0] == pair[1], zip(one, other, strict=False))
    return re.sub(r"[^\W\d_]+$", "", "".join(letter for letter, _ in pairs))
