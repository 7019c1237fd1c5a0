"""Data of one's own: what was understood of a folder, what only a person can say, what came in, and what was wrong."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.page.conftest import Served, serve_alone
from tests.page.looks import holds_up
from tests.page.steps import view

# What is computed goes behind everything else on the computer: on a busy one reading two files takes a minute.
WORK_MS = 180_000.0


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Served]:
    """Data are read where no bench is."""
    served = serve_alone(tmp_path)
    yield served
    served.end()


def stroke(file: Path, names: str, force_per_mm: float = 0.4) -> None:
    """3 mm of air, 6 mm into a spring and back, at 100 Hz."""
    way_mm = np.concatenate([np.linspace(-3, 6, 450), np.linspace(6, -3, 450)])
    noise_N = np.random.default_rng(1).normal(0, 0.003, 900)
    force_N = force_per_mm * np.maximum(way_mm, 0) + noise_N
    rows = (
        f"{0.01 * k:.2f},{way + 10:.4f},{force:.5f}" for k, (way, force) in enumerate(zip(way_mm, force_N, strict=True))
    )
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join([names, *rows]) + "\n")


@pytest.mark.timeout(600)
def test_a_folder_is_understood_asked_about_and_comes_in(page: Page, service: Served, tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    for name, force_per_mm in (("first", 0.4), ("second", 0.5)):
        stroke(mine / f"{name}.csv", "time_s,position_mm,force", force_per_mm)
    view(page, "Data")
    expect(page.locator("#read")).to_be_disabled()
    page.set_input_files("#folder", mine)
    expect(page.locator("#chosen")).to_contain_text("2 files")
    page.click("#read")
    columns = page.locator("#columns")
    expect(columns).to_contain_text("position_mm", timeout=WORK_MS)
    expect(page.locator("#questions")).to_contain_text("force")
    holds_up(page, "data")
    page.fill("#answer-0", "furlongs")
    page.fill("#import-session", "mine")
    page.click("#bring")
    expect(page.locator("#view")).to_contain_text("'furlongs'", timeout=WORK_MS)
    assert not (service.folder / "sessions" / "mine").exists()

    page.fill("#answer-0", "N")
    page.click("#bring")
    expect(page.locator("#came-in")).to_contain_text("2 recordings imported.", timeout=WORK_MS)
    expect(page.locator("#came-in")).to_contain_text("Fit takes it")
    holds_up(page, "data-came-in")
    assert len(list((service.folder / "sessions" / "mine").glob("*.mcap"))) == 2
    page.click("#open-session")
    expect(page).to_have_url(re.compile("#/session/mine$"))


@pytest.mark.timeout(600)
def test_files_that_hold_no_force_are_refused_in_a_sentence_and_a_mapping_can_be_written(
    page: Page, tmp_path: Path
) -> None:
    (tmp_path / "notes.csv").write_text("a,b\n1,2\n3,4\n")
    view(page, "Data")
    page.set_input_files("#files", tmp_path / "notes.csv")
    page.click("#read")
    expect(page.locator("#view")).to_contain_text("no table with force and position was found", timeout=WORK_MS)

    stroke(tmp_path / "one.csv", "t [s],way [mm],signal [N]")
    page.set_input_files("#files", tmp_path / "one.csv")
    page.click("#read")
    expect(page.locator("#columns")).to_contain_text("way [mm]", timeout=WORK_MS)
    page.click("text=Mapping: what each column is")
    expect(page.locator("#mapping")).to_have_value(re.compile(r"way \[mm\]"))


@pytest.mark.timeout(600)
def test_what_is_left_out_is_named_when_it_is_read_and_when_it_comes_in(page: Page, tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    stroke(mine / "one.csv", "time_s,position_mm,force_N")
    (mine / "about.txt").write_text("the gel was warm\n")
    (mine / ".DS_Store").write_bytes(b"\0\0\0\1Bud1")
    view(page, "Data")
    page.set_input_files("#files", [mine / name for name in ("one.csv", "about.txt", ".DS_Store")])
    page.click("#read")
    expect(page.locator("#left-out")).to_contain_text("hidden files: .DS_Store.")
    expect(page.locator("#doubts")).to_contain_text("about.txt", timeout=WORK_MS)
    page.fill("#import-session", "left")
    page.click("#bring")
    expect(page.locator("#came-in")).to_contain_text("were left out: about.txt", timeout=WORK_MS)
    page.set_input_files("#files", mine / "one.csv")
    expect(page.locator("#left-out")).to_have_count(0)
