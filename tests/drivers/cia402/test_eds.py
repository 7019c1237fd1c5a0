"""Data sheets: by python canopen's own reader where both read the same, and what is wrong with bad ones."""

from pathlib import Path

import canopen
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402.device import NEUTRAL, open_axis
from drivers.cia402.eds import LARGEST_BYTES, parse_eds, read_eds
from drivers.cia402.kind import NEEDED, check_sheet
from drivers.epos4.objects import TEXT
from rig.config.products.cia402 import Cia402Wiring
from rig.config.wiring import Limits
from rig.errors import UsageError

# Types of CiA 301 by the letter under which our table has them.
CIA_301 = {"B": 5, "H": 6, "I": 7, "b": 2, "h": 3, "i": 4}
SMALL = """
[DeviceInfo]
VendorNumber=0x5A
ProductNumber=010
ProductName=Small
[6040]
ParameterName=Controlword
ObjectType=0x7
DataType=0x0006
AccessType=rww
DefaultValue=
PDOMapping=1
[1403]
ParameterName=RPDO
SubNumber=1
[1403sub1]
ParameterName=COB-ID
DataType=0x7
AccessType=rw
DefaultValue=$NODEID+0x80000500
LowLimit=-5
HighLimit=0xFFFFFFFF
[2100]
ParameterName=Values
ObjectType=0x8
DataType=0x4
AccessType=ro
CompactSubObj=3
PDOMapping=1
"""


def test_every_object_of_the_neutral_sheet_is_what_canopen_reads_in_it() -> None:
    ours = read_eds(NEUTRAL)
    with NEUTRAL.open() as file:
        file.name  # noqa: B018 - canopen asks for it
        theirs = canopen.import_od(file, node_id=5)
    seen: dict[tuple[int, int], canopen.objectdictionary.ODVariable] = {}
    for index in theirs:
        members = theirs[index]
        subs = {0: members} if isinstance(members, canopen.objectdictionary.ODVariable) else members
        seen |= {(index, sub): subs[sub] for sub in subs}
    assert seen.keys() == ours.objects.keys()
    for key, variable in seen.items():
        entry = ours.objects[key]
        if entry.kind != TEXT:
            assert variable.data_type == CIA_301[entry.kind], entry
            assert variable.default == int(entry.default) + (5 if entry.by_node else 0), entry
        assert variable.access_type.startswith(entry.access.removesuffix("+")), entry
        assert variable.pdo_mappable is (entry.access[-1:] == "+"), entry
    assert (ours.vendor, ours.product, ours.name) == (0xFFFF, 0x402, "Neutral drive")


def test_numbers_node_defaults_bounds_and_short_arrays() -> None:
    sheet = parse_eds(SMALL, "small.eds")
    assert (sheet.vendor, sheet.product) == (0x5A, 8)
    assert sheet.objects[0x6040, 0].access == "rw+"
    identifier = sheet.objects[0x1403, 1]
    assert (identifier.default, identifier.by_node, identifier.low, identifier.high) == (
        0x80000500, True, -5, 0xFFFFFFFF
    )  # fmt: skip
    assert [sheet.objects[0x2100, sub].kind for sub in range(4)] == ["B", "i", "i", "i"]
    assert sheet.objects[0x2100, 0].default == 3
    assert (0x1403, 0) not in sheet.objects


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "bad.eds: is no electronic data sheet .*: it lists no object; check axis.eds"),
        ("hello", "bad.eds: is no electronic data sheet .*: File contains no section headers"),
        ("[6040]\nDataType=six\n", "bad.eds: is no electronic data sheet .*: invalid literal"),
        ("[6040]\nDataType=0x6\nCompactSubObj=999\n", "bad.eds: .*object 6040 has 999 elements"),
        ("[6040]\nDataType=6\nDefaultValue=08\n", "bad.eds: is no electronic data sheet"),
    ],
)
def test_what_is_no_data_sheet_is_one_sentence(text: str, told: str) -> None:
    with pytest.raises(UsageError, match=told) as refused:
        parse_eds(text, "bad.eds")
    assert "\n" not in str(refused.value)


def test_files_that_cannot_be_it_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no.eds: the data sheet cannot be read: No such file .*; check axis.eds"):
        read_eds(tmp_path / "no.eds")
    large = tmp_path / "large.eds"
    large.write_bytes(b";" * (LARGEST_BYTES + 1))
    with pytest.raises(UsageError, match=r"large.eds: 4000001 bytes are more than a data sheet has"):
        read_eds(large)


@pytest.mark.parametrize("entry", NEEDED, ids=str)
def test_each_needed_object_that_a_sheet_lacks_is_named_before_anything_is_opened(
    entry: object, tmp_path: Path
) -> None:
    index, sub = entry.index, entry.sub  # type: ignore[attr-defined]
    text = NEUTRAL.read_text()
    head = f"[{index:04X}]" if f"[{index:04X}sub0]" not in text else f"[{index:04X}sub{sub:X}]"
    path = tmp_path / "lacking.eds"
    path.write_text(text.replace(head, "[Comments]"))
    with pytest.raises(UsageError, match=rf"lacking.eds: lacks object {index:04X}:{sub:02X} .*, which an axis"):
        open_axis(Cia402Wiring(port="memory", eds=path), Limits())


def test_a_needed_object_of_another_type_is_named() -> None:
    text = NEUTRAL.read_text()
    at = text.index("[6064]")
    wrong = text[:at] + text[at:].replace("DataType=0x0004", "DataType=0x0003", 1)
    with pytest.raises(UsageError, match=r"x: object 6064:00 .* is of another type than CiA 402 gives it"):
        check_sheet(parse_eds(wrong, "x"), "x")


@given(text=st.one_of(st.text(max_size=200), st.lists(st.sampled_from(SMALL.splitlines())).map("\n".join)))
def test_any_text_is_a_sheet_or_a_usage_error(text: str) -> None:
    try:
        parse_eds(text, "any")
    except UsageError as refused:
        assert str(refused).startswith("any: ")
