"""`rig import`: the one sentence for every way files and their mapping can be wrong; nothing is written then."""

from collections.abc import Callable
from pathlib import Path

import pytest

from rig.errors import UsageError, WriteFailed
from rig.intake.mapping import MAPPING_FILE
from rig.recording.mcap_file import RecordingFailed
from tests.rig.recording.measured import FORCE, MAPPING, MARKER_TABLE, TABLES, run, write
from tests.rig.recording.test_mcap_file import disk_of

Spoil = Callable[[Path], object]


def force(content: str) -> Spoil:
    return lambda source: (source / "trial_02/force.csv").write_text(content)


def mapped(old: str, new: str) -> Spoil:
    return lambda source: (source / MAPPING_FILE).write_text((source / MAPPING_FILE).read_text().replace(old, new))


BAD: list[tuple[str, Spoil, str]] = [
    ("no mapping", lambda source: (source / MAPPING_FILE).unlink(), r"mapping\.toml: no such file"),
    ("broken toml", mapped("stated = {", "stated = "), r"mapping\.toml: cannot be read as TOML"),
    ("no tables", lambda source: (source / MAPPING_FILE).write_text(MAPPING), r"tables: Field required"),
    ("unknown key", mapped("time = ", "tiem = "), r"unknown key tables\.0\.tiem; nearest valid key: time"),
    ("unknown quantity", mapped("columns.force", "columns.forse"), r"columns\.forse"),
    (
        "unknown sense",
        mapped('"force_N" }', '"force_N", positive = "left" }'),
        r"positive: write compression or tension of a force, into or out of a position \(got 'left'\)",
    ),
    ("surface as text", mapped("surface_mm = 20.0", 'surface_mm = "top"'), r"surface_mm: .*\(got 'top'\)"),
    ("zero speed", mapped("speed_mm_s = 5.0", "speed_mm_s = 0"), r"speed_mm_s: .*greater than 0"),
    (
        "counter without rate",
        mapped('time = { column = "time_s" }', 'time = { column = "time_s", form = "counter" }'),
        r"rows and counters need their rate, for example rate_Hz = 1000\.0",
    ),
    (
        "facts of no recording",
        mapped("session = {", "recordings = { trial_99 = { speed_mm_s = 1 } }\nsession = {"),
        r"states facts of trial_99, and there is no such recording",
    ),
    ("no such file", mapped("force.csv", "kraft.csv"), r"no file is of .*kraft\.csv.*there are .*axis\.csv"),
    ("no such place", mapped('"{recording}"', '"{well}"'), r"'\{well\}' asks for 'well'; there are .*recording"),
    (
        "two under one name",
        mapped('recording = "{recording}"', 'recording = "one"'),
        r"force of recording one was there before; name what tells the two apart",
    ),
    ("no reader", mapped("force.csv", "force.*"), r"no reader for \.png"),
    ("empty file", force(""), r"trial_02/force\.csv: ends above line 2"),
    ("header only", force("time_s,force_N\n"), r"trial_02/force\.csv: ends above line 2"),
    ("one row", force("time_s,force_N\n1,2\n"), r"recording trial_02: only one row.* at least 2"),
    ("no header", force("0.0,1.0\n0.1,1.0\n"), r"force\.csv: no column 'time_s'; there are '0\.0', '1\.0'"),
    ("other name", force("time_s,Fz\n0,1\n1,2\n"), r"no column 'force_N'; there are 'time_s', 'Fz'"),
    ("column twice", force("time_s,force_N,force_N\n0,1,1\n1,2,2\n"), "'force_N' stands there 2 times; name it by"),
    ("semicolons", force("time_s;force_N\n0,0;1,0\n"), r"no column 'time_s'; .*'time_s;force_N'"),
    ("decimal commas", force("time_s,force_N\n0,0,1,5\n"), r"line 2: 4 cells where the header has 2"),
    (
        "quoted decimal commas",
        force('time_s,force_N\n0,"0,5"\n1,"1,5"\n'),
        r"line 2, column force_N: '0,5' is not a number; .*decimal = ','",
    ),
    (
        "thousands",
        force('time_s,force_N\n0,0\n1,"1,234.5"\n2,1\n'),
        r"line 3, column force_N: '1,234\.5' is not a number; .*thousands = ','",
    ),
    ("mixed units", force("time_s,force_N\n0,0\n1,5 mN\n2,1\n"), r"line 3, column force_N: '5 mN' is not a number"),
    ("time nan", force("time_s,force_N\n0,1\nNaN,1\n2,3\n"), r"line 3, column time_s: no time where one is needed"),
    ("text", force("time_s,force_N\n0,1\n1,N/A\n2,3\n"), r"column force_N: 'N/A' .*add it: missing = \['', 'N/A'\]"),
    ("short row", force("time_s,force_N\n0,1\n1\n2,3\n"), r"line 3: 1 cells where the header has 2"),
    ("same time", force("time_s,force_N\n0,1\n1,2\n1,3\n"), r"line 4: time 1 s follows 1 s; .* disorder = 'drop'"),
    ("backwards", force("time_s,force_N\n0,1\n2,2\n1,3\n"), r"line 4: time 1 s follows 2 s"),
    ("time in ns", force("time_s,force_N\n0,1\n2e18,2\n"), r"line 3, column time_s: 2e\+18 is beyond 9e\+09 s; .*unit"),
    (
        "latin-1",
        lambda source: (source / "trial_02/force.csv").write_bytes(b"time_s,force_N \xb0\n0,1\n1,2\n"),
        r"force\.csv line 1: not UTF-8; state its encoding, as in encoding = 'latin-1'",
    ),
    (
        "utf-16",
        lambda source: (source / "trial_02/force.csv").write_bytes(FORCE.encode("utf-16")),
        r"force\.csv line 1: not UTF-8; state its encoding",
    ),
    ("wrong encoding", mapped('time = { column = "time_s" }', 'encoding = "klingon"\ntime = { column = "time_s" }'),
     "'klingon' is no encoding"),
    ("binary", lambda at: (at / "trial_02/force.csv").write_bytes(bytes(range(256)) * 9), "not UTF-8|no column"),
    ("other unit", mapped('"force_N" }', '"force_N", unit = "kN" }'), r"'force_N' is in N by its header, .* says kN"),
    (
        "no unit",
        lambda source: (mapped('"force_N" }', '"F" }')(source), force("time_s,F\n0,1\n1,2\n")(source),
                        write(source, {"trial_01/force.csv": "time_s,F\n0,1\n1,2\n"})),
        r"nothing says the unit of 'F'; add to its force: unit = 'N'",
    ),
    ("unit of another", mapped('"force_N" }', '"time_s" }'), r"column 'time_s' is named twice in the mapping"),
    ("angle without lever", mapped('"position_mm" }', '"position_mm", unit = "deg" }'), r"is in mm by its header"),
    (
        "rows apart",
        lambda source: (
            write(source, {"all.csv": "s,t,F\na,0,1\nb,0,1\nb,1,1\na,1,1\na,2,1\nb,9,3\nb,10,3\n"}),
            (source / MAPPING_FILE).write_text(
                '[[tables]]\nfiles = "all.csv"\nlabel = "s"\ntime = { column = "t", unit = "s" }\n'
                'columns.force = { column = "F", unit = "N" }\n'
            ),
        ),
        r"only one row|recording a was there before",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("spoil", "sentence"), [case[1:] for case in BAD], ids=[case[0] for case in BAD])
def test_bad_input_ends_in_one_sentence_and_writes_nothing(source: Path, spoil: Spoil, sentence: str) -> None:
    (source / "trial_02/force.png").write_bytes(b"")
    spoil(source)
    before = sorted(source.parent.rglob("*"))
    with pytest.raises(UsageError, match=sentence) as caught:
        run(source)
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2
    assert sorted(source.parent.rglob("*")) == before


def test_no_folder_is_one_sentence(source: Path) -> None:
    source.rename(source.with_name("elsewhere"))
    with pytest.raises(UsageError, match="no such file"):
        run(source)


def test_rows_out_of_order_may_be_left_out_and_are_counted(source: Path) -> None:
    force("time_s,force_N\n9,1\n11,2\n10,3\n11,4\n12,5\n")(source)
    (source / MAPPING_FILE).write_text(MAPPING + TABLES.replace("time =", 'disorder = "drop"\ntime =') + MARKER_TABLE)
    session = run(source)
    assert session.recording("trial_02").tables["force"]["fz_N"].tolist() == [1.0, 2.0, 5.0]
    assert session.remarks == ("trial_02: 2 samples out of order in time, left out",)


def test_an_existing_session_is_not_overwritten(source: Path) -> None:
    run(source)
    with pytest.raises(UsageError, match="out: exists already and is not overwritten"):
        run(source)


def test_an_empty_folder_may_be_given_as_place(source: Path) -> None:
    (source.parent / "out").mkdir()
    assert len(run(source).trials) == 2


def test_a_full_disk_leaves_nothing_half_written(source: Path) -> None:
    before = sorted(source.parent.rglob("*"))
    with disk_of(4_000), pytest.raises(RecordingFailed, match="File too large"):
        run(source)
    assert sorted(source.parent.rglob("*")) == before


def test_a_place_that_cannot_be_written_is_one_sentence(source: Path) -> None:
    (source.parent / "file").write_text("")
    with pytest.raises(WriteFailed, match="cannot be written: Not a directory; nothing was left behind"):
        run(source, "file/out")
