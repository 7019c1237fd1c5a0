"""The encoding of a text that is no Unicode, told by the words of its header."""

import re
import unicodedata
from itertools import pairwise

from rig.intake.roles import knows
from rig.intake.units import unit_in

# Lines in which words of a header are looked for.
HEAD_ROWS = 400
# Of the encodings that laboratories' machines write, those of several bytes a letter first, those of DOS last.
ENCODINGS = (
    "gb18030", "cp949", "euc_jp", "shift_jis", "big5", "cp1252", "cp1250", "cp1251", "koi8-r", "cp850", "cp852",
    "cp437", "cp866",
)  # fmt: skip
STRAY_BYTES = 1  # WinTest ends its first line with a zero; more of them are numbers or what a power failure left
# Bytes of no text: tabs, ends of lines and pages, and the end of a file as DOS has it, are none of them.
_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0e-\x19\x1b-\x1f]")
_BETWEEN = re.compile(r"[\s,;|\"()\[\]/]+")
# Signs and letters with these names stand beside Latin ones (时间s, µm, °C), but not between them (Pr黤zeit).
_BESIDE = (
    "CJK", "HIRAGANA", "KATAKANA", "HANGUL", "FULLWIDTH", "HALFWIDTH", "IDEOGRAPHIC", "MICRO", "DEGREE", "SUPERSCRIPT",
    "GREEK", "OHM", "NO-BREAK",
)  # fmt: skip
_NEIGHBOURS = re.compile(r"(?<=[A-Za-z])([^\x00-\x7f]+)(?=([A-Za-z])?)|([^\x00-\x7f]+)(?=[A-Za-z])")


def encoding_of(head: bytes) -> tuple[str, tuple[str, ...]]:
    """The encoding whose header has most words that are known, empty of no text; a doubt where others have as many."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16", ()
    zeros = [head[start:HEAD_ROWS:2].count(0) for start in (0, 1)]
    if max(zeros) > len(head[:HEAD_ROWS]) // 4:  # of two bytes of a digit one is none
        return ("utf-16-be" if zeros[0] > zeros[1] else "utf-16-le"), ()
    header = b"\n".join(head.splitlines()[:HEAD_ROWS])
    if len(_CONTROL.findall(header)) > STRAY_BYTES:
        return "", ()
    return ("utf-8", ()) if _decodes(head, "utf-8") else _likeliest(header, [n for n in ENCODINGS if _decodes(head, n)])


def _likeliest(header: bytes, names: list[str]) -> tuple[str, tuple[str, ...]]:
    """The name under which most words are known, of those the one with the fewest that nobody writes."""
    texts = {name: header.decode(name, errors="replace") for name in names}
    # One byte is a letter that is a unit (с for seconds) in some of them by chance.
    words = {n: [w for w in _BETWEEN.split(text) if len(w.encode(n, "replace")) > 1] for n, text in texts.items()}
    words = {n: [w for w in own if not w.isascii()] for n, own in words.items()}
    odd = {name: sum(map(_is_odd, own)) for name, own in words.items()}
    known = {n: sum((knows(w) or bool(unit_in(w))) and not _is_odd(w) for w in own) for n, own in words.items()}
    # A byte beyond ASCII that stands alone between its letters is a letter of the West; others come in pairs and words.
    western = not re.search(rb"[\x80-\xff]{2}", header)
    best = max(names, key=lambda name: (known[name], -odd[name], western and name == "cp1252"), default="")
    others = [name for name in names if known[name] == known[best] and texts[name] != texts[best]]
    said = {n: next((line for line in texts[n].splitlines() if not line.isascii()), "") for n in (best, *others)}
    shown = {line: name for name, line in reversed(said.items())}  # each reading once, under its first name
    told = "; ".join(f"{name}: {line!r}" for line, name in reversed(shown.items()))
    return best, (f"the encoding may be {told}",) if others else ()


def _is_odd(word: str) -> bool:
    """Whether letters of another script stand among Latin ones as nobody writes them, or a capital behind a small."""
    capitals = any(one.islower() and two.isupper() and not two.isascii() for one, two in pairwise(word))
    return capitals or any(map(_stands_odd, _NEIGHBOURS.finditer(word)))


def _stands_odd(found: re.Match[str]) -> bool:
    """Whether what stands beside a Latin letter, or between two, is nothing that does."""
    alike = ("LATIN",) if found[2] else ("LATIN", *_BESIDE)
    return not all(unicodedata.name(letter, "").startswith(alike) for letter in found[1] or found[3])


def _decodes(head: bytes, name: str) -> bool:
    try:
        head[: head.rfind(b"\n") + 1 or len(head)].decode(name)
    except UnicodeDecodeError:
        return False
    return True
