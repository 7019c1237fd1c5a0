"""The fuzz run in small, that it finds a crash that was planted, and that no codec is missing from it."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import pytest

from benchmarks import fuzz, fuzz_codecs
from benchmarks.fuzz_codecs import Codec

ROOT = Path(__file__).parents[2]
EACH = 250
FOLDERS = ("drivers", "mock_devices", "examples/plugin-netft/src")
# What takes bytes and gives something else, and still takes nothing apart.
NO_CODECS = {
    "drivers/zaber/dialogue.py AsciiDialogue.heard": "hands them to LineDecoder",
}


def taking_apart(tree: ast.AST, inside: str = "") -> Iterator[str]:
    """Qualified names of the public functions that make something of bytes, or by their name of text."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef) and "Protocol" not in map(ast.unparse, node.bases):
            yield from taking_apart(node, f"{inside}{node.name}.")
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            kinds = {ast.unparse(arg.annotation) for arg in node.args.args if arg.annotation}
            made = ast.unparse(node.returns) if node.returns else ""
            named = node.name.startswith(("parse", "decode"))
            if ("bytes" in kinds and made not in ("None", "bytes")) or (named and "str" in kinds):
                yield inside + node.name


def all_codecs() -> set[str]:
    """Each as `path name`, but for what tests are made with."""
    files = (file for folder in FOLDERS for file in (ROOT / folder).rglob("*.py") if "testing" not in file.parts)
    return {
        f"{file.relative_to(ROOT)} {name}" for file in files for name in taking_apart(ast.parse(file.read_text()))
    } - NO_CODECS.keys()


def reached(tried: dict[str, Codec]) -> set[str]:
    """What a run enters, likewise."""
    entered: set[tuple[str, str]] = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call":
            entered.add((frame.f_code.co_filename, frame.f_code.co_qualname))

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        fuzz.run(60, 5, tried)
    finally:
        sys.setprofile(before)
    return {f"{Path(file).relative_to(ROOT)} {name}" for file, name in entered if file.startswith(str(ROOT))}


def test_no_codec_crashes_on_a_few_thousand_strings() -> None:
    tried = fuzz_codecs.codecs()
    assert fuzz.run(EACH, 7, tried) == []


def test_every_function_that_takes_bytes_apart_is_among_them() -> None:
    assert all_codecs() - reached(fuzz_codecs.codecs()) == set()


@pytest.mark.parametrize(
    ("left_out", "missing"),
    [
        ("zaber lines", "drivers/zaber/codec.py LineDecoder.feed"),
        ("laumas answers", "drivers/laumas/codec.py AnswerDecoder.feed"),
        ("optitrack models", "drivers/optitrack/models.py decode_models"),
        ("netft records", "examples/plugin-netft/src/rig_netft/netft.py parse"),
    ],
)
def test_a_codec_that_is_left_out_is_named(left_out: str, missing: str) -> None:
    tried = fuzz_codecs.codecs()
    del tried[left_out]
    assert missing in all_codecs() - reached(tried)


def test_a_new_codec_is_seen_and_what_makes_bytes_is_none() -> None:
    text = "class New:\n    def feed(self, data: bytes) -> list[int]: ...\n"
    text += "def parse_line(line: str) -> int: ...\n"
    text += "def encode(data: bytes) -> bytes: ...\ndef send(data: bytes) -> None: ...\n"
    assert list(taking_apart(ast.parse(text))) == ["New.feed", "parse_line"]


@pytest.mark.parametrize(
    ("mock", "words"),
    [
        ("ndi mock", b"SET Param.Simulated Alerts=\xb2\r"),
        ("zaber mock", b"/1 move vel nan\n/1 get pos\n"),
        ("zaber mock", b"/1 set limit.max inf\n/1 get limit.max\n"),
        ("zaber mock", b"/1 set accel 0\n/1 move abs 5000\n"),
    ],
)
def test_words_that_are_no_numbers_end_no_mock(mock: str, words: bytes) -> None:
    """A digit of Latin-1 that `int` does not read, a NaN, an infinity and a ramp without an end."""
    take = fuzz_codecs.codecs()[mock].take
    for _ in range(5):
        take(words)


def test_messages_of_each_protocol_are_understood_by_its_codec() -> None:
    """Spoilt ones alone would never get past a checksum."""
    understood = {"zaber lines": 4, "robotiq frames": 1, "modbus requests": 3, "slcan stream": 1}
    for name, least in understood.items():
        codec = fuzz_codecs.codecs()[name]
        made = [codec.take(example) for example in codec.examples]
        assert sum(len(found) for found in made if isinstance(found, list)) >= least, name


def test_a_planted_crash_is_found_and_told_with_its_string(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fragile(data: bytes) -> int:
        return data[3]

    monkeypatch.setattr(fuzz, "codecs", lambda: {"fragile": Codec(fragile), "well": Codec(len)})
    assert fuzz.main(["--each", "1000", "--seed", "1"]) == 1
    lines = capsys.readouterr().out.splitlines()
    found, none, both = ([field.strip() for field in line.strip("|").split("|")] for line in lines[2:5])
    assert (found[:2], none[0], none[3]) == (["fragile", "1,000"], "well", "0")
    assert both == ["2 codecs", "2,000", "", found[3]] and int(found[3]) > fuzz.MOST_SHOWN
    assert len(lines[5:]) == fuzz.MOST_SHOWN
    assert all(line.startswith("fragile: IndexError: index out of range on ") for line in lines[5:])
    assert max(len(bytes.fromhex(line.rpartition(" ")[2])) for line in lines[5:]) <= 3
    assert fuzz.main(["--each", "1000", "--only", "we*"]) == 0


def test_a_codec_that_is_not_there_is_wrong_use(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        fuzz.main(["--only", "zebra*"])
    assert ended.value.code == 2
    assert "no codec is called like zebra*; there are bota frames, " in capsys.readouterr().err


def test_what_a_codec_may_raise_is_no_crash_and_anything_else_is() -> None:
    def refuse(data: bytes) -> None:
        raise ValueError(data)

    assert fuzz.run(50, 1, {"refusing": Codec(refuse, (ValueError,))}) == []
    assert len(fuzz.run(50, 1, {"refusing": Codec(refuse, (KeyError,))})) == 50


def test_the_same_seed_makes_the_same_strings() -> None:
    seen: list[list[bytes]] = [[], []]
    for strings in seen:
        fuzz.run(200, 3, {"seen": Codec(strings.append)})
    assert seen[0] == seen[1]
    assert len(set(seen[0])) > 150
