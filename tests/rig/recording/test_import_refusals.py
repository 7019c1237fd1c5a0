"""`rig import`: the one sentence for every way measured files can be wrong; nothing is written then."""

from collections.abc import Callable
from pathlib import Path

import pytest

from rig.errors import UsageError
from rig.recording.files import WriteFailed
from rig.recording.importing import import_session
from rig.recording.mcap_file import RecordingFailed
from tests.rig.recording.measured import FORCE, NOW, TRIAL, run, write
from tests.rig.recording.test_mcap_file import disk_of

Spoil = Callable[[Path], object]


def text(name: str, content: str) -> Spoil:
    return lambda source: (source / name).write_text(content)


def force(content: str) -> Spoil:
    return text("trial_02/force.csv", content)


BAD: list[tuple[str, Spoil, str]] = [
    ("no folder", lambda source: source.rename(source.with_name("elsewhere")), "measured: no such folder"),
    ("no session.toml", lambda source: (source / "session.toml").unlink(), r"no session\.toml in it"),
    ("broken toml", text("session.toml", "surface_mm = \n"), r"session\.toml: cannot be read as TOML: .*line 1"),
    (
        "session in latin-1",
        lambda source: (source / "session.toml").write_bytes(b'site="\xe9"'),
        "cannot be read as TOML",
    ),
    (
        "unknown key",
        text("session.toml", 'force_postive = "tension"'),
        r"session\.toml: unknown key force_postive; nearest valid key: force_positive",
    ),
    (
        "unknown sense",
        text("session.toml", 'force_positive = "left"'),
        r"force_positive: write 'compression'.* or 'tension'",
    ),
    (
        "unknown sense",
        text("session.toml", 'position_positive = "north"'),
        r"position_positive: write 'into'.* or 'out'",
    ),
    ("number as sense", text("session.toml", "force_positive = 2"), r"force_positive: write 'compression'"),
    ("surface as text", text("session.toml", 'surface_mm = "top"'), r"session\.toml: surface_mm: .*\(got 'top'\)"),
    ("surface NaN", text("session.toml", "surface_mm = nan"), r"surface_mm: .*finite"),
    ("no trial.toml", lambda source: (source / "trial_02/trial.toml").unlink(), r"trial_02/trial\.toml: no such file"),
    ("no speed", text("trial_02/trial.toml", "depth_mm = 8.0"), r"trial_02/trial\.toml: speed_mm_s: Field required"),
    ("no depth", text("trial_02/trial.toml", "speed_mm_s = 8.0"), r"trial_02/trial\.toml: depth_mm: Field required"),
    (
        "negative speed",
        text("trial_02/trial.toml", "speed_mm_s = -5\ndepth_mm = 8"),
        r"speed_mm_s: .*greater than 0 \(got -5\)",
    ),
    ("zero speed", text("trial_02/trial.toml", "speed_mm_s = 0\ndepth_mm = 8"), r"speed_mm_s: .*greater than 0"),
    (
        "unknown trial key",
        text("trial_02/trial.toml", TRIAL + "speed = 1"),
        "unknown key speed; nearest valid key: speed_mm_s",
    ),
    ("no force", lambda source: (source / "trial_02/force.csv").unlink(), r"trial_02/force\.csv: no such file"),
    ("no axis", lambda source: (source / "trial_02/axis.csv").unlink(), r"trial_02/axis\.csv: no such file"),
    ("empty file", force(""), r"trial_02/force\.csv line 1: no column time_s in the header ''"),
    ("header only", force("time_s,force_N\n"), r"trial_02/force\.csv: no row under the header"),
    ("one row", force("time_s,force_N\n1,2\n"), r"trial_02/force\.csv: only one row under the header; .* at least 2"),
    (
        "no header",
        force("0.0,1.0\n0.1,1.0\n"),
        r"line 1: no column time_s in the header '0\.0,1\.0'; .*--columns force\.time_s",
    ),
    (
        "other name",
        force("time_s,Fz\n0,1\n1,2\n"),
        r"no column force_N in the header 'time_s,Fz'; .* say --columns force\.force_N=NAME",
    ),
    (
        "force in kN",
        force("time_s,force_kN\n0,1\n1,2\n"),
        r"line 1: .*force_kN is in kN, N is needed: convert the file",
    ),
    ("time in ms", force("time_ms,force_N\n0,1\n1,2\n"), r"line 1: .*time_ms is in ms, s is needed: convert the file"),
    ("column twice", force("time_s,force_N,force_N\n0,1,1\n1,2,2\n"), "column force_N stands 2 times"),
    ("semicolons", force("time_s;force_N\n0,0;1,0\n"), "separate columns by commas and write decimals with points"),
    ("decimal commas", force("time_s,force_N\n0,0,1,5\n"), r"line 2: 4 cells where the header has 2"),
    ("nan", force("time_s,force_N\n0,1\n1,nan\n2,3\n"), r"line 3, column force_N: nan where a number is needed"),
    ("infinity", force("time_s,force_N\n0,1\n1,-inf\n2,3\n"), r"line 3, column force_N: -inf where a number is needed"),
    (
        "empty cell",
        force("time_s,force_N\n0,1\n1,\n2,3\n"),
        r"line 3, column force_N: nothing where a number is needed",
    ),
    ("time nan", force("time_s,force_N\n0,1\nNaN,1\n2,3\n"), r"line 3, column time_s: NaN where a number is needed"),
    ("text", force("time_s,force_N\n0,1\n1,abc\n2,3\n"), r"line 3, column force_N: 'abc' is not a number"),
    ("underscore", force("time_s,force_N\n0,1\n1,1_0\n2,3\n"), r"line 3, column force_N: '1_0' is not a number"),
    ("short row", force("time_s,force_N\n0,1\n1\n2,3\n"), r"line 3: 1 cells where the header has 2"),
    (
        "same time",
        force("time_s,force_N\n0,1\n1,2\n1,3\n"),
        r"line 4, column time_s: 1\.0 s follows 1\.0 s; time must increase",
    ),
    ("backwards", force("time_s,force_N\n0,1\n2,2\n1,3\n"), r"line 4, column time_s: 1\.0 s follows 2\.0 s"),
    ("time in ns", force("time_s,force_N\n1e18,1\n2e18,2\n"), r"line 2, column time_s: 1e\+18 s is beyond 9e\+09 s"),
    (
        "latin-1",
        lambda source: (source / "trial_02/force.csv").write_bytes(b"time_s,force_N\n0,1\n1,2 \xb0\n"),
        r"trial_02/force\.csv line 3: not UTF-8 text; save the file as UTF-8",
    ),
    (
        "utf-16",
        lambda source: (source / "trial_02/force.csv").write_bytes(FORCE.encode("utf-16")),
        r"trial_02/force\.csv line 1: not UTF-8 text; save the file as UTF-8",
    ),
    ("binary", lambda source: (source / "trial_02/force.csv").write_bytes(bytes(range(256))), "not UTF-8|no column"),
    (
        "half a marker",
        text("trial_02/marker.csv", "time_s,x_mm,y_mm,z_mm\n0,1,2,3\n1,1,,3\n2,1,2,3\n"),
        r"marker\.csv line 3, column y_mm: nothing where a number is needed",
    ),
    (
        "marker without time",
        text("trial_02/marker.csv", "time_s,x_mm,y_mm,z_mm\n0,1,2,3\n,,,\n"),
        r"line 3, column time_s: nothing",
    ),
    ("empty marker", text("trial_02/marker.csv", "time_s,x_mm,y_mm,z_mm\n"), r"marker\.csv: no row under the header"),
    (
        "trial number twice",
        lambda source: (source / "trial_01").rename(source / "trial_2"),
        "trial_02 and trial_2 have the same number; remove the duplicate",
    ),
    (
        "trial copied",
        lambda source: write(source, {"trial_02/force.csv": (source / "trial_01/force.csv").read_text()}),
        r"trial_01 and trial_02 have the same data in force\.csv; remove the duplicate",
    ),
    (
        "no trials",
        lambda source: [(source / name).rename(source / f"x{name}") for name in ("trial_01", "trial_02")],
        "no trial in it; each trial is a folder trial_NAME",
    ),
]


@pytest.mark.parametrize(("spoil", "sentence"), [case[1:] for case in BAD], ids=[case[0] for case in BAD])
def test_bad_input_ends_in_one_sentence_and_writes_nothing(source: Path, spoil: Spoil, sentence: str) -> None:
    spoil(source)
    before = sorted(source.parent.rglob("*"))
    with pytest.raises(UsageError, match=sentence) as caught:
        run(source)
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2
    assert sorted(source.parent.rglob("*")) == before


@pytest.mark.parametrize(
    "column", ["force_N", "force.force_N=", "=Fz", "force.position_mm=x", "torque_Nm=T", ".force_N=F", "tool.time_s=t"]
)
def test_a_column_option_that_fits_nothing_is_refused(source: Path, column: str) -> None:
    with pytest.raises(UsageError, match=r"write FIELD=HEADER with one of force\.time_s, force\.force_N"):
        run(source, column)


def test_a_column_given_by_option_must_not_name_another_unit(source: Path) -> None:
    write(
        source, {"trial_02/force.csv": "time_s,Fz [kN]\n0,1\n1,2\n", "trial_01/force.csv": "time_s,Fz [kN]\n0,1\n1,2\n"}
    )
    with pytest.raises(UsageError, match=r"column Fz \[kN\] is in kN by its name; force_N is needed"):
        run(source, "force_N=Fz [kN]")


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
        import_session(source, source.parent / "file" / "out", [], NOW)
