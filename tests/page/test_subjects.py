"""Subjects: names beside codes, stiffness over sessions, everything taken along, everything erased."""

import json
import math
import zipfile
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from api.http.access.scopes import Scope
from tests.api.catalogue.made import fitted, make_session
from tests.page.conftest import Served
from tests.page.looks import holds_up
from tests.page.people import somebody
from tests.page.steps import view

NAME = "Ann Unmistakable-Example"


def softened(folder: Path, a_N_mm: float) -> None:
    """The session with a model of another stiffness."""
    file = fitted(folder) / "fit" / "model.json"
    model = json.loads(file.read_text())
    model["parameters"]["a_N_mm"] = a_N_mm
    model["intervals"]["a_N_mm"] = [a_N_mm, a_N_mm]
    file.write_text(json.dumps(model))


@pytest.fixture
def lab(service: Served) -> Path:
    """Two sessions of S01, three weeks apart, and one of another."""
    root = service.folder / "sessions"
    softened(make_session(root, "early", created="2026-11-01T10:00:00+00:00"), 0.12)
    softened(make_session(root, "late", created="2026-11-22T10:00:00+00:00"), 0.06)
    make_session(root, "other", {"id": "S 02/ä", "site": "calf"})
    return root


@pytest.mark.timeout(200)
def test_a_subject_is_found_named_seen_over_time_taken_along_and_erased(
    page: Page, service: Served, lab: Path, browser: Browser, tmp_path: Path
) -> None:
    view(page, "Subjects")
    rows = page.locator("#subjects tr")
    expect(rows).to_have_count(2)
    holds_up(page, "subjects")
    page.fill("#subject-search", "02/ä")
    expect(rows).to_have_count(1)
    page.get_by_role("link", name="S 02/ä").click()
    expect(page.locator("h1")).to_have_text("Subject S 02/ä")
    expect(page.locator("#view")).to_contain_text("No session of this subject is fitted yet")

    view(page, "Subjects")
    page.get_by_role("link", name="S01").click()
    page.fill("#subject-name", NAME)
    page.click("#keep-name")
    expect(page.locator("h1")).to_have_text(f"{NAME} (S01)")
    # F = a x exp(b x) at rest, at the 10.05 mm that both models cover.
    stiffness = [a * math.exp(0.22 * 10.048704807575362) for a in (0.06, 0.12)]
    for row, expected in zip(page.locator("#subject-sessions tr").all(), stiffness, strict=True):
        expect(row).to_contain_text(f"{expected:.3g} N/mm")
    expect(page.locator("#stiffness-plot canvas")).to_be_visible()

    with somebody(browser, service, "eve", Scope.READ) as reader:
        view(reader, "Subjects")
        expect(reader.locator("#subjects")).to_contain_text("not shown to you")
        reader.get_by_role("link", name="S01").click()
        expect(reader.locator("h1")).to_have_text("Subject S01")
        expect(reader.locator("#view")).to_contain_text("Only administrators may erase")
        expect(reader.locator("#export")).to_have_count(0)
        assert NAME not in reader.content()

    with page.expect_download() as download:
        page.click("#export")
    download.value.save_as(tmp_path / "taken.zip")
    with zipfile.ZipFile(tmp_path / "taken.zip") as archive:
        assert {name.split("/")[1] for name in archive.namelist() if "/" in name} == {"early", "late"}
        assert json.loads(archive.read("subject.json"))["subject"]["name"] == NAME

    page.click("#erase")
    expect(page.locator("#erase-plan")).to_contain_text("This would erase 2 sessions")
    assert (lab / "early").is_dir()
    expect(page.locator("#erase-now")).to_be_disabled()
    holds_up(page, "subject")
    page.fill("#erase-code", "S01")
    page.click("#erase-now")
    expect(page.locator("#message")).to_have_text("Subject S01 is erased, with 2 sessions.")
    expect(rows).to_have_count(1)
    assert [path.name for path in lab.iterdir() if not path.name.startswith(".")] == ["other"]
