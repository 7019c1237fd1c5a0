"""The report in a real browser without a network: it draws, in light, dark and on paper, and asks for nothing."""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, sync_playwright

from api.operations.fit import fit
from controller.operation import Operation
from mock_devices.testing.browser import launch
from mock_devices.testing.made.synthetic import Bench, write_made_session
from rig.recording.sessions import open_session
from rig.report.page import write_report
from tests.rig.report.test_page import track_into
from tests.system.browser import find

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("wire")]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium as installed here."""
    executable = find()
    with sync_playwright() as playwright:
        browser = launch(playwright, executable)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report on a small session."""
    folder = tmp_path_factory.mktemp("made") / "session"
    write_made_session(folder, Bench(rate_Hz=500.0).cycles(trials=1, speeds_mm_s=(5.0, 30.0)))
    track_into(folder)
    fit(Operation("fit"), [folder])
    write_report(open_session(folder), folder / "report.html")
    return folder / "report.html"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_shows_its_pictures_offline(browser: Browser, report: Path, scheme: str) -> None:
    with browser.new_context(offline=True, color_scheme="dark" if scheme == "dark" else "light") as context:
        page = context.new_page()
        complaints: list[str] = []
        requests: list[str] = []
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(report.as_uri())
        pictures = page.locator("figure svg")
        assert pictures.count() == 5
        for index in range(pictures.count()):
            pixels = np.asarray(Image.open(io.BytesIO(pictures.nth(index).screenshot())).convert("L"), float)
            assert min(pixels.shape) > 200
            assert np.std(pixels) > 5
        background = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("L"), float)[2, 2]
        assert (background > 128) == (scheme == "light")
        assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
        assert complaints == []
        assert requests == [report.as_uri()]


def test_the_page_fits_a_telephone_and_a_sheet_of_paper(browser: Browser, report: Path) -> None:
    with browser.new_context(offline=True, viewport={"width": 390, "height": 800}) as context:
        page = context.new_page()
        page.goto(report.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
        assert page.pdf(format="A4").startswith(b"%PDF")
