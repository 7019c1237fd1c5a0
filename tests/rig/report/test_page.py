"""The report as a page: what it says, what it says where something is missing, and that it needs nothing but itself."""

import json
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from api.cli.fitting import laws_from
from api.operations.fit import fit
from controller.operation import Operation
from mock_devices.testing.made.synthetic import (
    Bench,
    index_force,
    metadata,
    tables,
    write_made_session,
    write_recording,
)
from rig.errors import DataError, UsageError
from rig.recording.sessions import JsonTable, SessionInfo, TrialInfo, open_session, write_session
from rig.report.page import write_report

VOID = {"meta", "link", "br", "img", "hr", "input"}
LEVEL = {
    "given_N": 2.0, "actual_N": 2.001, "error_N": 0.001, "error_percent": 0.05, "max_error_N": 0.01,
    "max_error_percent": 0.5, "rms_error_N": 0.004, "overshoot_percent": 1.2, "settling_s": None,
}  # fmt: skip


TRACKED = {
    "recording": "track_001.mcap", "model": "fit/model.json", "max_error_percent": 0.5, "rms_error_N": 0.004,
    "levels": [LEVEL], "samples": 2000, "dropped": 0, "loop": {"ticks": 2000, "missed": 0}, "quality": "good",
    "followed": {"rms_error_N": 0.02, "largest_error_N": 0.4, "amplitude_ratio": None, "lag_s": None},
}  # fmt: skip


class Page(HTMLParser):
    """Reads a page as a browser would: visible text, headings, references, and whether every tag is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text: list[str] = []
        self.headings: list[str] = []
        self.tags: list[str] = []
        self.references: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.references += [
            value or "" for name, value in attrs if name in ("src", "href", "xlink:href", "data", "action")
        ]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.text.append(data)
        if self.open and self.open[-1] in ("h1", "h2"):
            self.headings.append(data)

    @property
    def words(self) -> str:
        """All visible text."""
        return " ".join(" ".join(self.text).split())


def track_into(folder: Path) -> None:
    """A force-tracking run of two seconds on 2 N."""
    run = Bench().cycle(10.0, 1)
    streams = tables(run)
    loop = streams["loop"]
    loop["force_N"][500:] = 2.0 + 0.01 * np.sin(np.arange(len(loop) - 500) / 50)
    loop["reference_N"][500:] = 2.0
    loop["missed"][800:] = 3
    write_recording(folder / "track_001.mcap", streams, metadata(run) | {"trial": {"kind": "tracking"}})
    (folder / "track.json").write_text(json.dumps(TRACKED))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole session: trials, tracking, and a subject who writes HTML."""
    folder = tmp_path_factory.mktemp("made") / "session"
    cycles = Bench(rate_Hz=500.0).cycles(trials=1, speeds_mm_s=(5.0, 10.0, 20.0, 30.0))
    subject: JsonTable = {"id": "<script>alert(1)</script>", "site": 'fore & "arm"'}
    write_made_session(folder, cycles, subject=subject, protocol={"name": "indentation", "speeds_mm_s": [5.0, 10.0]})
    fit(Operation("fit"), [folder], laws=laws_from("layer", ["thickness_mm=30"], "layer"))
    track_into(folder)
    return folder


@pytest.fixture(scope="module")
def html(folder: Path) -> str:
    """Its report."""
    write_report(open_session(folder), folder / "report.html")
    return (folder / "report.html").read_text(encoding="utf-8")


def test_the_page_is_well_formed_and_has_all_parts(html: str) -> None:
    page = Page(html)
    assert page.open == []
    assert page.headings[1:] == [
        "Force and displacement", "Tissue laws compared", "Force tracking", "What the simulation gets wrong",
        "What came in", "The loop", "What was recorded", "Bench, subject and protocol",
    ]  # fmt: skip
    assert page.tags.count("svg") == 5


def test_the_headline_says_what_came_out(html: str) -> None:
    headline = Page(html).headings[0]
    assert re.fullmatch(
        r"The index law predicts displacement on left\u2011out trials within [\d.]+ mm \([\d.]+ %\), "
        r"constant stiffness within [\d.]+ mm \([\d.]+ %\); force was tracked within 0.5 %",
        headline.replace("\u00a0", " "),
    )


def test_nothing_is_loaded_from_outside(html: str) -> None:
    page = Page(html)
    assert "script" not in page.tags
    assert not {"link", "iframe", "object", "embed", "img"} & set(page.tags)
    assert page.references
    assert all(reference.startswith("#") for reference in page.references)
    assert all(target.startswith("#") for target in re.findall(r"url\(\s*['\"]?([^)'\"]+)", html))
    assert "@import" not in html
    assert "default-src 'none'" in html


def test_what_people_wrote_is_shown_and_not_run(html: str) -> None:
    assert "<script>" not in html
    words = Page(html).words
    assert "<script>alert(1)</script>" in words
    assert 'fore & "arm"' in words


def test_recordings_devices_and_privileges_are_listed(html: str) -> None:
    words = Page(html).words
    for said in ("trial_500", "track_001", "BFT-SENS", "000271", "SCHED_FIFO 50", "tissue-rig 0.1.0"):
        assert said in words
    assert "real time: scheduler" in words
    assert "5 recordings 5 complete and without loss" in words
    assert "0 dropped samples" in words


def test_tracking_is_a_table_of_reference_and_actual_force(html: str) -> None:
    words = Page(html).words
    assert "2.00 2.001 +0.001 +0.05 0.010 0.0040 1.2 –" in words
    assert "0.5 % worst force-tracking error 0.004 N rms" in words


def test_missed_cycles_are_counted_within_recordings(html: str) -> None:
    assert "3 missed loop cycles" in Page(html).words
    assert "3 cycles were missed while recording" in Page(html).words


def test_an_input_that_never_came_has_no_age(html: str) -> None:
    words = Page(html).words
    assert "age of force when used 400 400 400" in words
    assert "age of marker" not in words


def test_a_bench_of_real_ports_is_not_called_simulated(html: str) -> None:
    assert "Simulated bench" not in html


def test_a_bench_on_pseudo_terminals_is_called_simulated(tmp_path: Path) -> None:
    cycle = Bench().cycle(10.0, 1)
    folder = write_made_session(tmp_path / "session", [Bench().cycle(10.0, 2)])
    about = metadata(cycle) | {"wiring": {"force": '{"port": "/dev/pts/4"}'}}
    (folder / "trial_002.mcap").unlink()
    write_recording(folder / "trial_002.mcap", tables(cycle), about)
    write_report(open_session(folder), tmp_path / "report.html")
    assert "Simulated bench: the devices were served on pseudo-terminals" in (tmp_path / "report.html").read_text()


def test_a_session_without_curves_loop_tracking_or_devices_still_has_a_report(tmp_path: Path) -> None:
    cycle = Bench(force=index_force(a_N_mm=1e-6, damping_N_s_mm=0.0)).cycle(10.0, 1)
    streams = {name: table for name, table in tables(cycle).items() if name != "loop"}
    folder = tmp_path / "session"
    folder.mkdir()
    write_recording(folder / "trial_001.mcap", streams, {"recording": {"kind": "import"}})
    trial = TrialInfo("trial_001", "trial_001.mcap", 10.0, 8.0, "imported")
    write_session(folder, SessionInfo("bare", "import", "2026-01-02", "tissue-rig 0.1.0", trials=(trial,)))
    write_report(open_session(folder), tmp_path / "report.html")
    page = Page((tmp_path / "report.html").read_text())
    assert page.headings[0] == "1 recording, without a fit"
    for said in (
        "This session was not fitted; `rig fit", "No force was tracked in this session", "No loop ran in this session",
        "The recordings name no device", "No protocol: imported data", "0 dropped samples",
    ):  # fmt: skip
        assert said in page.words
    assert page.tags.count("svg") == 1, "what came in"


def test_damage_and_cuts_are_said_on_the_page(tmp_path: Path) -> None:
    folder = write_made_session(tmp_path / "session", [Bench().cycle(10.0, 1), Bench().cycle(20.0, 2)])
    cut = folder / "trial_002.mcap"
    cut.write_bytes(cut.read_bytes()[:-3000])
    (folder / "session.json").write_text("{")
    write_report(open_session(folder), tmp_path / "report.html")
    words = Page((tmp_path / "report.html").read_text()).words
    assert "session.json cannot be read: the session is taken from its recordings" in words
    assert "trial_002.mcap: incomplete" in words
    assert "1 complete and without loss" in words


@pytest.mark.parametrize("content", ["{", "[]", '{"levels": 3}', '{"levels": [], "max_error_percent": "much"}'])
def test_an_unreadable_tracking_result_is_one_line(tmp_path: Path, content: str) -> None:
    folder = write_made_session(tmp_path / "session", [Bench().cycle(10.0, 1)])
    track_into(folder)
    (folder / "track.json").write_text(content)
    write_report(open_session(folder), tmp_path / "report.html")
    page = Page((tmp_path / "report.html").read_text())
    assert "No table of reference and actual force" in page.words
    assert "tracked within" not in page.headings[0]


def test_a_tracking_run_without_contact_is_one_line(tmp_path: Path) -> None:
    folder = write_made_session(tmp_path / "session", [Bench().cycle(10.0, 1)])
    run = Bench().cycle(10.0, 5)
    write_recording(folder / "track_001.mcap", tables(run), metadata(run) | {"trial": {"kind": "tracking"}})
    write_report(open_session(folder), tmp_path / "report.html")
    assert "The tracking run track_001 never came into contact." in (tmp_path / "report.html").read_text()


def test_the_report_replaces_an_older_one_and_leaves_no_scraps(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    out.write_text("old")
    write_report(open_session(folder), out)
    assert "old" not in out.read_text()[:20]
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_a_place_that_is_not_there_is_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"its folder does not exist"):
        write_report(open_session(folder), tmp_path / "missing" / "report.html")


def test_the_quality_of_each_trial_is_shown_and_why_it_is_not_good(tmp_path: Path) -> None:
    folder = write_made_session(tmp_path / "session", Bench(rate_Hz=500.0).cycles(trials=2, speeds_mm_s=(10.0,)))
    info = open_session(folder).info
    spoilt = replace(info.trials[0], quality="usable", reasons=("axis: a gap of 58 ms (good up to 20 ms)",))
    write_session(folder, replace(info, trials=(spoilt, replace(info.trials[1], quality="good"))))
    write_report(open_session(folder), folder / "report.html")
    words = Page((folder / "report.html").read_text(encoding="utf-8")).words
    assert f"{spoilt.name}: quality usable: axis: a gap of 58 ms (good up to 20 ms)" in words
    assert f"{info.trials[1].name}: quality" not in words


def test_a_folder_without_a_session_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"no session here"):
        write_report(open_session(tmp_path), tmp_path / "report.html")


def test_the_fit_shown_is_the_one_that_was_asked_for(html: str) -> None:
    words = Page(html).words
    assert "Given, not fitted: thickness_mm = 30." in words
    assert "layer thickness_mm 30 known mm" in words
    assert "K and B for control (layer)" in words


def test_the_report_reads_the_saved_fit_and_computes_nothing_again(folder: Path, tmp_path: Path) -> None:
    again = tmp_path / "session"
    shutil.copytree(folder, again)
    saved = json.loads((again / "fit" / "fit.json").read_text())
    saved["index"]["parameters"]["a_N_mm"]["value"] = 4321.0
    (again / "fit" / "fit.json").write_text(json.dumps(saved))
    write_report(open_session(again), again / "report.html")
    assert "a_N_mm 4321" in Page((again / "report.html").read_text()).words


def test_a_fit_that_is_older_than_its_session_says_so(folder: Path, tmp_path: Path) -> None:
    again = tmp_path / "session"
    shutil.copytree(folder, again)
    assert "run `rig fit` again" not in Page((folder / "report.html").read_text()).words
    info = open_session(again).info
    first, second, third, *rest = info.trials
    changed, later = replace(second, sha256="0" * 64), replace(third, name="trial_later")
    write_session(again, replace(info, trials=(changed, later, *rest)))
    (again / first.file).unlink()
    write_report(open_session(again), again / "report.html")
    words = Page((again / "report.html").read_text()).words
    assert f"{first.name}, which the fit was made from, is not in the session" in words
    assert f"{second.name} was changed after the fit" in words
    assert "trial_later was recorded after the fit and is not in it" in words
