"""Electronic data sheets of CANopen nodes (CiA 306): who the node is, and which objects it has of which type."""

import configparser
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from drivers.epos4.objects import I8, I16, I32, TEXT, U8, U16, U32, Access, Entry
from rig.errors import UsageError

# The longest data sheet seen, of a drive with 2,000 objects, has 0.4 MB: more is another file.
LARGEST_BYTES = 4_000_000
# Types of CiA 301 by their number; what is longer than four bytes or without a fixed length is carried as text.
KINDS = {0x1: "?", 0x2: I8, 0x3: I16, 0x4: I32, 0x5: U8, 0x6: U16, 0x7: U32, 0x1B: "Q", 0x15: "q"}
_SECTION = re.compile(r"([0-9A-F]{4})(?:SUB([0-9A-F]{1,2}))?", re.IGNORECASE)
_ACCESS = {"const": "const", "wo": "wo", "ro": "ro"}
Section = Mapping[str, str]


@dataclass(frozen=True)
class DataSheet:
    """One node's data sheet; ``vendor`` and ``product`` are 0 where it does not say."""

    vendor: int
    product: int
    name: str
    objects: Mapping[tuple[int, int], Entry]


def read_eds(path: Path) -> DataSheet:
    """The data sheet in ``path``; raises UsageError naming the file and what is wrong with it."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path}: the data sheet cannot be read: {error.strerror}; check axis.eds") from error
    if len(data) > LARGEST_BYTES:
        raise UsageError(f"{path}: {len(data)} bytes are more than a data sheet has ({LARGEST_BYTES}); check axis.eds")
    return parse_eds(data.decode("latin-1"), str(path))


def parse_eds(text: str, where: str) -> DataSheet:
    """The data sheet in ``text``; raises UsageError beginning with ``where``."""
    sections = configparser.RawConfigParser(strict=False, interpolation=None)
    try:
        sections.read_string(text)
        objects = dict(_objects(sections))
        about: Section = sections["DeviceInfo"] if sections.has_section("DeviceInfo") else {}
        vendor, product = (_number(about.get(key, "0") or "0") for key in ("vendornumber", "productnumber"))
    except (configparser.Error, ValueError) as error:
        raise UsageError(f"{where}: is no electronic data sheet (CiA 306): {str(error).splitlines()[0]}") from error
    if not objects:
        raise UsageError(f"{where}: is no electronic data sheet (CiA 306): it lists no object; check axis.eds")
    return DataSheet(vendor, product, about.get("productname", "").strip(), objects)


def _objects(sections: configparser.RawConfigParser) -> Iterator[tuple[tuple[int, int], Entry]]:
    for name in sections.sections():
        match = _SECTION.fullmatch(name)
        if match:
            yield from _entries(int(match[1], 16), int(match[2] or "0", 16), sections[name])


def _entries(index: int, sub: int, section: Section) -> Iterator[tuple[tuple[int, int], Entry]]:
    """One variable; an array that is written in short has its elements by their number."""
    if "datatype" not in section:
        return
    count = _number(section.get("compactsubobj", "0") or "0")
    if not 0 <= count <= 0xFE:
        raise ValueError(f"object {index:04X} has {count} elements")
    if count:
        yield (index, 0), Entry(index, 0, "number of entries", U8, "const", count)
    for number in range(1, count + 1) if count else [sub]:
        yield (index, number), _entry(index, number, section)


def _entry(index: int, sub: int, section: Section) -> Entry:
    kind = KINDS.get(_number(section["datatype"]), TEXT)
    access = section.get("accesstype", "rw").lower()
    mappable = section.get("pdomapping", "0").strip() == "1"
    plain = _ACCESS.get(access, "rw")
    default = section.get("defaultvalue", "").strip()
    by_node = "$NODEID" in default.upper()
    return Entry(
        index,
        sub,
        section.get("parametername", "object"),
        kind,
        cast(Access, f"{plain}+" if mappable and plain in ("ro", "rw") else plain),
        default if kind == TEXT else _number(re.sub(r"(?i)\$NODEID\s*\+?|\+\s*\$NODEID", "", default) or "0"),
        _bound(kind, section.get("lowlimit", "")),
        _bound(kind, section.get("highlimit", "")),
        by_node,
    )


def _bound(kind: str, text: str) -> int | None:
    return _number(text) if text.strip() and kind != TEXT else None


def _number(text: str) -> int:
    """As CiA 306 writes numbers: decimal, 0x hexadecimal, or octal with a leading 0."""
    text = text.strip()
    negative, digits = text.startswith("-"), text.lstrip("-")
    octal = len(digits) > 1 and digits.startswith("0") and digits.isdigit()
    value = int(digits, 8) if octal else int(digits, 0)
    return -value if negative else value
