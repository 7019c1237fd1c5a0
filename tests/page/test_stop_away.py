"""The stop of an encrypted page, from another computer and on the bench's own, while the service stands still."""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, Playwright, expect

from mock_devices.testing.browser import launch
from mock_devices.testing.commands import RIG, ROOT, ServedBench, children, free_port, until
from tests.api.access.tls import made
from tests.page.conftest import Served
from tests.page.steps import state
from tests.system.browser import find

NAME = "bench.example.org"


@pytest.fixture
def service(bench: ServedBench, tmp_path: Path) -> Iterator[Served]:
    """With a certificate, and with what takes stops from other computers."""
    files = made(tmp_path, NAME, "localhost")
    encrypted = ["--name", NAME, "--tls-cert", str(files.certificate), "--tls-key", str(files.key)]
    process = subprocess.Popen(
        [*RIG, "serve", "--port", str(free_port()), *encrypted, *bench.settings("stop.port=0")], cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout
    served = Served(bench, process, process.stdout.readline().strip(), tmp_path)
    try:
        yield served
    finally:
        served.end()


@pytest.fixture
def page(service: Served, playwright: Playwright, request: pytest.FixtureRequest) -> Iterator[Page]:
    """The page at the name in the test's parameter, once stops have a way past the service."""
    other = launch(playwright, find(), f"--host-resolver-rules=MAP {NAME} 127.0.0.1")
    page = other.new_page(ignore_https_errors=True)
    page.goto(service.address.replace(NAME, request.param))

    def told() -> bool:
        return bool(page.evaluate("async () => (await (await fetch('/api/v1/info')).json()).away_stops"))

    until(told, 60.0, "the process beside the service")
    expect(page.locator("#stop-alone")).to_have_count(0)
    yield page
    other.close()


@pytest.mark.parametrize("page", [NAME, "localhost"], indirect=True)
@pytest.mark.timeout(200)
def test_it_is_confirmed_while_the_service_stands_still(page: Page, service: Served) -> None:
    state(page, "ready")
    service.suspend()
    page.keyboard.press("Escape")
    expect(page.locator("#stop-banner")).to_contain_text("Emergency stop: confirmed by the loop: ")


@pytest.mark.parametrize("page", [NAME], indirect=True)
@pytest.mark.timeout(200)
def test_where_nothing_takes_it_the_page_says_so(page: Page, service: Served) -> None:
    state(page, "ready")
    (away,) = children(service.process.pid, "api.http.stops.server")
    os.kill(away, signal.SIGSTOP)
    expect(page.locator("#stop-alone")).to_contain_text("From here STOP goes through the service alone")
    expect(page.locator("#stop-alone")).to_have_count(0)
    (away,) = children(service.process.pid, "api.http.stops.server")
    service.suspend()
    os.kill(away, signal.SIGSTOP)
    page.keyboard.press("Escape")
    expect(page.locator("#stop-banner")).to_contain_text("NOT CONFIRMED: use the hardware stop")
    os.kill(away, signal.SIGKILL)  # frozen, it would outlast its service
