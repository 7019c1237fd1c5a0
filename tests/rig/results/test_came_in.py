"""What came in, of a session whose faults were planted: every number is known by how it was made."""

import csv
import io
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pytest
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from mock_devices.testing.made.synthetic import Bench, metadata, tables, write_recording
from rig.config.table import load
from rig.intake.mapping import MAPPING_FILE, DataMapping
from rig.recording import sessions
from rig.recording.reader import Recording, read_recording
from rig.recording.sessions import SessionInfo, TrialInfo, open_session, write_session
from rig.report.came_in import CameIn, came_in_of, look_at, save_came_in
from rig.report.came_in_figure import FOOT_PT, MOST, ROW_PT, TITLE_PT, came_in_figure
from rig.report.ink import QUIET
from rig.report.panels import TICK_PT, Box, Panel, span, ticks
from rig.results.came_in import CameInResult, RecordingIn, StreamIn, Use
from rig.results.came_in_tables import as_csv, short_parts
from rig.results.came_in_trace import trace_of
from rig.results.incoming import Looked, _in_air, came_in_result
from rig.results.seen import Rests, see
from rig.results.tables import TextTable
from rig.tissue.study import curves_of
from rig.trials import surface
from rig.trials.contact import Contact, find_contact
from rig.trials.cycles import IndentationCycle
from rig.trials.opening import import_files
from rig.trials.thinning import extremes
from tests.rig.recording.measured import MAPPING, NOW, TABLES, pressed, run, write

SVG = "{http://www.w3.org/2000/svg}"
RATE_HZ, NOISE_N, STEP_N, SURFACE_MM, CLIP_N, COARSE_N = 500.0, 0.01, 0.001, 20.0, 3.0, 0.25
LOST = np.r_[300:320, 600:606]
UNVOUCHED = slice(100, 103)


def planted() -> dict[str, tuple[IndentationCycle, np.ndarray]]:
    """Cycles by name, and which rows of force were kept."""
    clean = Bench(rate_Hz=RATE_HZ, noise_N=NOISE_N, quantum_N=STEP_N, surface_mm=SURFACE_MM).cycle(10.0, 7)
    every = np.ones(len(clean.time_s), bool)
    some = every.copy()
    some[LOST] = False
    deep = clean.position_mm > SURFACE_MM + 1.0
    shaking = deep * 10 * NOISE_N * np.random.default_rng(5).standard_normal(len(clean.time_s))
    return {
        "clean": (clean, every),
        "clipped": (replace(clean, force_N=np.minimum(clean.force_N, CLIP_N)), every),
        "dropped": (clean, some),
        "constant": (replace(clean, force_N=np.full_like(clean.force_N, 0.5)), every),
        "coarse": (replace(clean, force_N=COARSE_N * np.round(clean.force_N / COARSE_N)), every),
        "shaken": (replace(clean, force_N=clean.force_N + shaking), every),
    }


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("planted") / "session"
    folder.mkdir()
    trials = []
    for name, (cycle, kept) in planted().items():
        streams = {key: table for key, table in tables(cycle).items() if key != "loop"}
        streams["force"] = streams["force"][kept]
        streams["force"]["valid"][UNVOUCHED] = name != "shaken"
        write_recording(folder / f"{name}.mcap", streams, metadata(cycle))
        trials.append(TrialInfo(name, f"{name}.mcap", 10.0, 8.0, "imported", samples={"force": int(kept.sum())}))
    write_session(folder, SessionInfo("planted", "import", "2026-01-02", "tissue-rig 0.1.0", trials=tuple(trials)))
    return folder


@pytest.fixture(scope="module")
def result(folder: Path) -> CameInResult:
    return came_in_result(open_session(folder))


@pytest.fixture
def found(result: CameInResult) -> dict[str, RecordingIn]:
    return {recording.name: recording for recording in result.recordings}


def force_of(recording: RecordingIn) -> StreamIn:
    force = recording.stream("force")
    assert force is not None
    return force


def test_a_good_recording_says_rate_noise_step_and_contact(found: dict[str, RecordingIn]) -> None:
    clean, (cycle, _) = found["clean"], planted()["clean"]
    force = force_of(clean)
    assert (force.samples, force.missing, force.gaps, force.lost) == (len(cycle.time_s), 0, 0, 0)
    assert (force.rate_Hz, force.lowest_rate_Hz) == pytest.approx((RATE_HZ, RATE_HZ), rel=1e-3)
    assert force.span_s == pytest.approx((len(cycle.time_s) - 1) / RATE_HZ)
    assert force.noise == pytest.approx(np.hypot(NOISE_N, STEP_N / np.sqrt(12)), rel=0.15)
    assert (force.noise_from, force.saturated, force.saturated_at) == ("air", 0.0, ())
    assert force.resolution == pytest.approx(STEP_N)
    (one,) = clean.cycles
    assert one.contact_low_mm is not None and one.contact_high_mm is not None
    lag_mm = 10.0 * Bench().filter_s
    assert one.contact_low_mm - lag_mm <= SURFACE_MM <= one.contact_high_mm
    assert (clean.quality, clean.reasons, clean.one_clock) == ("good", (), True)
    assert clean.fit == Use(used=True)


def test_a_clipped_force_says_what_share_stands_where(found: dict[str, RecordingIn]) -> None:
    force, true_N = force_of(found["clipped"]), planted()["clean"][0].force_N
    assert force.saturated == pytest.approx(np.mean(true_N >= CLIP_N))
    assert force.saturated_at == (CLIP_N,)
    assert found["clipped"].quality == "usable"
    assert any("end of its range, 3;" in reason for reason in found["clipped"].reasons)


def test_noise_is_that_of_the_air_and_samples_nobody_vouches_for_are_missing(found: dict[str, RecordingIn]) -> None:
    force = force_of(found["shaken"])
    assert (force.missing, force.samples) == (3, len(planted()["clean"][0].time_s) - 3)
    assert force.noise == pytest.approx(NOISE_N, rel=0.15)
    rests = Rests(np.array([15.0, 19.5, 25.0, 25.0, 25.0]), np.array([1.0, 1.0, 9.0, 9.0, 9.0]))
    in_air = _in_air(force.model_copy(update={"noise": 9.0, "noise_from": "rest"}), rests, found["shaken"].cycles)
    assert (in_air.noise, in_air.noise_from) == (1.0, "air")


def test_dropped_frames_are_gaps(found: dict[str, RecordingIn]) -> None:
    force = force_of(found["dropped"])
    assert (force.gaps, force.samples) == (2, len(planted()["clean"][0].time_s) - len(LOST))
    assert force.longest_gap_s == pytest.approx(21 / RATE_HZ)
    assert force.lowest_rate_Hz == pytest.approx(RATE_HZ / 21)
    assert not found["dropped"].one_clock


def test_a_constant_channel_is_bad_and_says_so(found: dict[str, RecordingIn]) -> None:
    constant = found["constant"]
    assert (constant.quality, constant.fit.used) == ("bad", False)
    assert constant.reasons == ("force: constant at 0.5: the stream carries nothing",)
    assert "no contact" in constant.fit.why
    assert force_of(constant).longest_repeat == force_of(constant).samples


def test_a_coarse_force_says_its_step(found: dict[str, RecordingIn]) -> None:
    assert force_of(found["coarse"]).resolution == pytest.approx(COARSE_N)
    assert any(f"steps of {COARSE_N:g} over its range" in reason for reason in found["coarse"].reasons)


def test_times_that_repeat_are_counted_though_the_import_left_them_out(tmp_path: Path) -> None:
    rows = [f"{0.001 * k:.3f},{0.1 * k:.1f}\n" for k in range(40)]
    twice = "time_s,force_N\n" + "".join(rows[:10] + [rows[9]] * 3 + rows[10:])
    places = "time_s,position_mm\n" + "".join(rows)
    files = {
        MAPPING_FILE: MAPPING + TABLES.replace("[[tables]]", "[[tables]]\ndisorder = 'drop'"),
        "trial_01/force.csv": twice,
        "trial_01/axis.csv": places,
    }
    session = run(write(tmp_path / "measured", files))
    (recording,) = came_in_result(session).recordings
    force, axis = recording.stream("force"), recording.stream("axis")
    assert force is not None and axis is not None
    assert (force.left_out, force.samples, axis.left_out) == (3, 40, 0)
    assert not recording.diagnose.used
    assert "1 recording of one cycle: a cause is judged on cycles left out" in recording.diagnose.why


def test_what_does_not_open_or_holds_no_force_is_bad_and_says_why(tmp_path: Path) -> None:
    cycle = planted()["clean"][0]
    streams = {"axis": tables(cycle)["axis"]}
    write_recording(tmp_path / "still.mcap", streams, metadata(cycle))
    (tmp_path / "torn.mcap").write_bytes(b"torn")
    trials = tuple(TrialInfo(name, f"{name}.mcap", 10.0, 8.0, "imported") for name in ("still", "torn"))
    write_session(tmp_path, SessionInfo("odd", "import", "2026-01-02", "tissue-rig 0.1.0", trials=trials))
    session = open_session(tmp_path)
    still, torn = came_in_result(session).recordings
    assert (still.quality, torn.quality, torn.streams) == ("bad", "bad", ())
    assert "no valid force samples" in still.fit.why and "not a recording" in torn.fit.why
    assert not (still.diagnose.used or torn.diagnose.used)
    drawn = see(session.recording("still")).trace
    assert np.isnan(drawn.points.force_N).all()
    assert np.ptp(drawn.points.place_mm) == pytest.approx(np.ptp(cycle.position_mm))
    assert "<svg" in look_at(session).picture
    many_rows = replace(
        session, info=replace(session.info, trials=(replace(trials[0], samples={"force": 40_000_000}),))
    )
    said = "40000000 rows, 40000000 of them in one recording, were not looked at (limits 30000000 and 4000000)"
    assert came_in_result(many_rows).remarks[0].startswith(said)


def test_what_a_diagnosis_takes_is_asked_of_the_diagnosis(found: dict[str, RecordingIn]) -> None:
    assert {name: recording.diagnose.used for name, recording in found.items()} == {
        "clean": True, "clipped": True, "dropped": True, "constant": False, "coarse": True,
        "shaken": True,
    }  # fmt: skip


def test_the_table_is_the_same_in_every_form(result: CameInResult, found: dict[str, RecordingIn]) -> None:
    overview = next(part for part in short_parts(result) if isinstance(part, TextTable))
    assert [row[0] for row in overview.rows] == list(found)
    assert overview.rows[1][4] == f"{100 * force_of(found['clipped']).saturated:.2g}"
    rows = list(csv.DictReader(io.StringIO(as_csv(result))))
    assert [(row["recording"], row["stream"]) for row in rows[:3]] == [
        ("clean", "force"), ("clean", "axis"), ("clipped", "force"),
    ]  # fmt: skip
    assert float(rows[2]["saturated"]) == force_of(found["clipped"]).saturated
    assert rows[2]["saturated_at"] == "3"


def test_what_was_saved_is_shown_until_a_recording_changes(folder: Path, result: CameInResult) -> None:
    session = open_session(folder)
    save_came_in(session, CameIn(result.model_copy(update={"session": "as saved"}), "<svg/>"))
    assert came_in_of(session).result.session == "as saved"
    other = replace(session.info, trials=(replace(session.trials[0], sha256="changed"), *session.trials[1:]))
    assert came_in_of(replace(session, info=other)).result.session == "planted"


def test_the_picture_marks_what_was_planted(folder: Path, result: CameInResult) -> None:
    session = open_session(folder)
    traces = {name: see(session.recording(name)).trace for name in planted()}
    assert traces["clipped"].full == np.count_nonzero(planted()["clean"][0].force_N >= CLIP_N)
    assert set(traces["clipped"].at_end.force_N) == {CLIP_N}
    assert [stop - start for start, stop in traces["dropped"].gaps_s] == pytest.approx([21 / RATE_HZ, 7 / RATE_HZ])
    check_room(came_in_figure(result, traces))


Extent = tuple[float, float, float, float]


def check_room(drawn: str) -> None:
    """That no words reach out of the picture, into a panel or over other words."""
    root = ElementTree.fromstring(drawn)
    width_pt, height_pt = (float(size) for size in root.attrib["viewBox"].split()[2:])
    frames = [frame_of(path) for path in root.iter(f"{SVG}path") if path.attrib.get("stroke") == QUIET]
    assert len(frames) == 12
    found = [extent_of(text) for text in root.iter(f"{SVG}text") if text.text != "×"]
    assert len(found) > 12 * 8
    for number, one in enumerate(found):
        assert one[0] >= 0 and one[1] <= width_pt and one[2] >= 0 and one[3] <= height_pt
        assert not any(overlap(one, other) for other in (*frames, *found[:number]))


def overlap(one: Extent, other: Extent) -> bool:
    return one[0] < other[1] and other[0] < one[1] and one[2] < other[3] and other[2] < one[3]


def frame_of(path: Element) -> Extent:
    """The frame above its lower edge: left, right, top and bottom [pt]."""
    left, foot, right = (float(number) for number in re.findall(r"[\d.]+", path.attrib["d"]))
    return left, right, foot - (ROW_PT - TITLE_PT - FOOT_PT), foot


def extent_of(text: Element) -> Extent:
    """Left, right, top and bottom of a line of text [pt], by the widths of its font's letters."""
    weight, size = text.attrib.get("font-weight", "normal"), float(text.attrib.get("font-size", TICK_PT))
    face = FontProperties(family="DejaVu Sans", weight=weight, size=size)
    wide = float(TextPath((0, 0), text.text or "", prop=face).get_extents().width)
    if "transform" in text.attrib:
        foot, middle = (float(number) for number in re.findall(r"[\d.]+", text.attrib["transform"])[:2])
        return foot - size, foot, middle - wide / 2, middle + wide / 2
    at, share = float(text.attrib["x"]), {"start": 0.0, "middle": 0.5, "end": 1.0}[text.attrib["text-anchor"]]
    foot = float(text.attrib["y"])
    return at - share * wide, at + (1 - share) * wide, foot - 0.75 * size, foot


def test_a_line_of_the_picture_goes_through_its_values() -> None:
    panel = Panel(Box(100.0, 10.0, 50.0, 20.0), (0.0, 1.0), (-1.0, 1.0), ("", ""))
    panel.line(np.array([0.0, 0.5, np.nan, 1.0]), np.array([-1.0, 1.0, 0.0, 0.0]), "")
    assert 'd="M100.0 30.0L125.0 10.0L150.0 20.0"' in panel.parts[-1]
    assert ticks(-0.3, 7.9) == {0.0: "0", 2.0: "2", 4.0: "4", 6.0: "6"}
    assert list(ticks(-0.012, 0.011).values()) == ["\N{MINUS SIGN}0.01", "0.00", "0.01"]
    assert list(ticks(2.0e6, 6.1e6).values()) == ["2e+06", "4e+06", "6e+06"]
    assert span(np.full(3, 2.0)) == (1.9, 2.1) and span(np.array([np.nan])) == (0.0, 1.0)


def test_a_ramp_keeps_as_many_points_as_a_hold_ten_times_as_long() -> None:
    place_mm = np.interp(np.arange(11_000), [0, 1000], [0.0, 8.0])
    drawn = trace_of(np.arange(11_000.0), place_mm**2, place_mm, np.zeros(11_000, bool))
    on_ramp = np.count_nonzero(drawn.points.time_s < 1000)
    assert 200 < on_ramp < 300 and drawn.points.force_N.max() == 64.0


def test_names_are_text_of_the_picture_and_nothing_else(result: CameInResult, folder: Path) -> None:
    session = open_session(folder)
    recording = replace_name(next(one for one in result.recordings if one.name == "clean"), "<b>&")
    trace = see(session.recording("clean")).trace
    drawn = came_in_figure(result.model_copy(update={"recordings": (recording,)}), {"<b>&": trace})
    assert "<b>&: good" in [text.text for text in ElementTree.fromstring(drawn).iter(f"{SVG}text")]
    assert came_in_figure(result, {}) == ""


def replace_name(recording: RecordingIn, name: str) -> RecordingIn:
    return recording.model_copy(update={"name": name})


def test_the_samples_that_are_drawn_reach_as_far_as_all_of_them() -> None:
    random = np.random.default_rng(3)
    force_N = random.standard_normal(100_000)
    kept = extremes(force_N, 500)
    assert len(kept) <= 500 and (np.diff(kept) > 0).all()
    runs = np.array_split(force_N, 250)
    assert force_N[kept].tolist() == [
        value for run in runs for value in run[sorted({int(run.argmin()), int(run.argmax())})]
    ]


def test_the_contact_of_a_cycle_is_searched_once_and_a_recording_is_read_once(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    searches, reads = list[float](), list[Path]()

    def search(*given: Any) -> Contact:
        searches.append(given[3])
        return find_contact(*given)

    def read(path: Path) -> Recording:
        reads.append(path)
        return read_recording(path)

    monkeypatch.setattr(surface, "find_contact", search)
    monkeypatch.setattr(sessions, "read_recording", read)
    session = open_session(folder)
    curves_of(session)
    of_fit = len(searches)
    reads.clear()
    look_at(session)
    assert of_fit and len(searches) == 2 * of_fit
    assert [path.stem for path in reads] == list(planted())


def test_an_import_looks_at_recordings_in_memory_as_their_files_hold_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cycles = [Bench(rate_Hz=100.0).cycle(speed, seed) for seed, speed in enumerate((5.0, 10.0))]
    source, reads, seen = pressed(tmp_path / "in", cycles, ""), list[Path](), dict[str, Recording]()
    looked = Looked()

    def see(info: TrialInfo, recording: Recording) -> None:
        seen[info.name] = recording
        looked.add(info, recording)

    session = import_files(source, load(DataMapping, source / MAPPING_FILE), tmp_path / "out", NOW, see=see)
    for name, recording in seen.items():
        stored = session.recording(name)
        assert (stored.metadata, stored.complete, stored.damage) == (recording.metadata, True, ())
        assert stored.tables.keys() == recording.tables.keys()
        for stream, rows in stored.tables.items():
            assert rows.tobytes() == recording.tables[stream].tobytes(), stream
    expected = look_at(session)
    monkeypatch.setattr(sessions, "read_recording", reads.append)
    assert look_at(session, looked=looked) == expected
    assert not reads
    with pytest.raises(AttributeError):
        look_at(session)


def test_what_is_too_long_to_be_held_is_neither_seen_nor_judged_and_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rig.intake.writing.LONGEST_ROWS", 100)
    source = pressed(tmp_path / "in", [Bench(rate_Hz=100.0).cycle(5.0, 1)], "stated.speed_mm_s = 500")
    seen: list[str] = []
    mapping = load(DataMapping, source / MAPPING_FILE)
    session = import_files(source, mapping, tmp_path / "out", NOW, see=lambda info, _: seen.append(info.name))
    assert not seen and session.trials[0].quality == ""
    said = "what is stated of trial_0 was not held against its motion: above 4000000 rows"
    assert session.remarks[-1] == said


def test_an_import_waits_for_no_library_that_draws_or_that_its_files_do_not_need(tmp_path: Path) -> None:
    """pandas and matplotlib take half a second each to load, which numbers read from text and a picture had brought."""
    source = pressed(tmp_path / "in", [Bench(rate_Hz=100.0).cycle(5.0, 1)], "")
    code = (
        "import sys; sys.argv[1:] = {argv!r}\ntry:\n    from api.cli.app import main; main()\nexcept SystemExit: pass\n"
        "print(sorted({{'pandas', 'matplotlib', 'h5py', 'scipy.io'}} & sys.modules.keys()))"
    ).format(argv=["import", str(source), "--out", str(tmp_path / "out")])
    found = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert (tmp_path / "out" / "what-came-in.svg").is_file()
    assert found.stdout.splitlines()[-1] == "[]"


def many(count: int, bad: tuple[int, ...]) -> CameInResult:
    use = Use(used=True)
    recordings = [
        RecordingIn(
            name=f"{k}", streams=(), one_clock=True, alignments={}, cycles=(), reasons=(), fit=use, diagnose=use,
            quality="bad" if k in bad else "good",
        )
        for k in range(count)
    ]  # fmt: skip
    return CameInResult(session="many", recordings=tuple(recordings), sha256={})


def test_of_many_the_first_the_worst_and_some_between_are_shown_and_that_is_said() -> None:
    assert many(MOST, ()).shown(MOST) == (many(MOST, ()).recordings, "")
    bad = (77, 130, 131, 299)
    chosen, said = many(300, bad).shown(MOST)
    names = [int(recording.name) for recording in chosen]
    assert len(names) == len(set(names)) == MOST and names == sorted(names)
    assert {0, 1, 2, 3, *bad} <= set(names)
    assert max(np.diff(names)) < 20
    assert said == "27 of 300 recordings: the first 4, 4 of which most is to be said, and 19 from all over the others"
    worst = many(300, tuple(range(100, 200))).shown(MOST)[0]
    assert sum(recording.quality == "bad" for recording in worst) == 13 + 3


def test_looking_at_what_came_in_waits_for_no_library_that_only_a_diagnosis_needs() -> None:
    """Both take half a second to load, which a chirp transform and a distribution had brought into every import."""
    code = "import sys, rig.results.incoming; print(sorted({'scipy.signal', 'scipy.stats'} & sys.modules.keys()))"
    found = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert found.stdout.strip() == "[]"
