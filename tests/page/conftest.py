"""The page in a real browser over `rig serve` and the mock bench; screenshots of every test are kept."""

import os
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import pytest
from playwright.sync_api import Browser, Page, Playwright, expect, sync_playwright

import hatch_build
from mock_devices.testing.browser import launch
from mock_devices.testing.commands import PATIENCE_S, RIG, ROOT, ServedBench, free_port, served_bench
from tests.page.looks import PICTURES
from tests.system.browser import find
from tests.system.presses import SHORT, SLOW

expect.set_options(timeout=PATIENCE_S * 1000)


# These need neither bench nor service.
ALONE = (
    "test_build", "test_states", "test_every_view", "test_language", "test_plots", "test_lost_answers", "test_sign_in",
    "test_head", "test_sessions_told", "test_run_steps",
)  # fmt: skip


@pytest.hookimpl(tryfirst=True)  # before the tests are dealt out to workers by group
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "tests/page" in item.nodeid:
            alone = any(name in item.nodeid for name in ALONE)
            item.add_marker(pytest.mark.xdist_group("alone" if alone else "page"))
            if not alone:
                item.add_marker(pytest.mark.bench)


@dataclass
class Served:
    """A bench, the service over it and where its page is."""

    bench: ServedBench
    process: "subprocess.Popen[str]"
    address: str
    folder: Path

    @property
    def origin(self) -> str:
        """The address without the page's own part."""
        return self.address.partition("/#")[0]

    def suspend(self) -> None:
        """Lets the service hang."""
        self.process.send_signal(signal.SIGSTOP)

    def resume(self) -> None:
        """Lets it go on."""
        self.process.send_signal(signal.SIGCONT)

    def end(self) -> None:
        """Ends it, also where it hangs."""
        self.resume()
        self.process.terminate()
        self.process.wait(30)
        if self.process.stdout:
            self.process.stdout.close()


def serve(bench: ServedBench, folder: Path, port: int = 0) -> Served:
    """`rig serve` in ``folder``, listening."""
    port = port or free_port()
    command = [*RIG, "serve", "--port", str(port), "--protocols", "protocols", *bench.settings()]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True)
    assert process.stdout
    address = process.stdout.readline().strip()
    assert address.startswith(f"http://127.0.0.1:{port}/")
    return Served(bench, process, address, folder)


class NoBench:
    """The wiring file says all."""

    def settings(self) -> list[str]:
        """None."""
        return []


# Of a bench that is somewhere else.
WIRING = """
[force]
product = "bota-sensone"
port = "/dev/no-sensor"
[axis]
product = "maxon-epos4"
port = "/dev/no-adapter"
increments_per_mm = 2000
"""


def serve_alone(folder: Path) -> Served:
    """`rig serve` in ``folder`` where no bench is."""
    (folder / "protocols").mkdir()
    (folder / "rig.toml").write_text(WIRING)
    return serve(cast("ServedBench", NoBench()), folder)


@pytest.fixture(scope="session", autouse=True)
def built() -> None:
    """The page is that of the sources."""
    hatch_build.build()


@pytest.fixture
def bench() -> Iterator[ServedBench]:
    """A fresh mock bench."""
    with served_bench("--seed", "1") as served:
        yield served


@pytest.fixture
def protocols() -> dict[str, str]:
    """Their texts, by name."""
    return {"slow": SLOW, "short": SHORT}


@pytest.fixture
def service(bench: ServedBench, tmp_path: Path, protocols: dict[str, str]) -> Iterator[Served]:
    """A served bench with protocols."""
    (tmp_path / "protocols").mkdir()
    for name, text in protocols.items():
        (tmp_path / "protocols" / f"{name}.toml").write_text(text)
    served = serve(bench, tmp_path)
    try:
        yield served
    finally:
        served.end()


@pytest.fixture(scope="session")
def playwright() -> Iterator[Playwright]:
    """What starts browsers; there is one in a process."""
    with sync_playwright() as started:
        yield started


@pytest.fixture(scope="session")
def browser(playwright: Playwright) -> Iterator[Browser]:
    """One browser for all; each test has a context of its own."""
    browser = launch(playwright, find())
    yield browser
    browser.close()


@pytest.fixture
def errors() -> list[str]:
    """What went wrong in the page's own program."""
    return []


@pytest.fixture
def page(service: Served, browser: Browser, errors: list[str], request: pytest.FixtureRequest) -> Iterator[Page]:
    """The page, opened at the address that the service printed; a program error in it fails the test."""
    context = browser.new_context()
    page = context.new_page()
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(service.address)
    yield page
    PICTURES.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=PICTURES / f"{request.node.name[:80]}.png")
    context.close()
    assert errors == []
