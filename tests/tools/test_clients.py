"""The table of clients says what the tests that run them did, and cannot go stale unseen."""

import ast
import re
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from tools import clients
from tools.clients import BEGIN, CLIENTS, END, PAGE, ROOT, TESTS, Outcome

REPORT = """<testsuites><testsuite>
<testcase classname="tests.mock_devices.epos4.test_clients" name="test_canopen_reads[1]"/>
<testcase classname="tests.mock_devices.epos4.test_clients" name="test_canopen_writes"><failure/></testcase>
<testcase classname="tests.mock_devices.robotiq.test_mock.TestClients" name="test_pymodbus_reads"/>
<testcase classname="tests.mock_devices.epos4.test_being" name="test_its_own_classes"><skipped/></testcase>
<testcase classname="tests.mock_devices.epos4.test_mock" name="test_canopen_of_another_file"/>
</testsuite></testsuites>"""


def test_a_report_is_read_case_by_case() -> None:
    assert clients.outcomes(REPORT)[:3] == [
        Outcome("epos4/test_clients.py", "test_canopen_reads[1]", True),
        Outcome("epos4/test_clients.py", "test_canopen_writes", False),
        Outcome("robotiq/test_mock.py", "test_pymodbus_reads", True),
    ]


def test_passed_failed_and_skipped_are_counted_by_client() -> None:
    rows = clients.table(clients.outcomes(REPORT)).splitlines()[2:]
    lines = {tuple(map(str.strip, line.split("|")[1:3])): line for line in rows}
    assert lines["Robotiq FT 300", "pymodbus"].endswith("| 1 | 0 |")
    assert lines["maxon EPOS4", "being"] == "| maxon EPOS4 | being | 1.0.2 | 0 | 1 |"
    canopen = [line for line in clients.table(clients.outcomes(REPORT)).splitlines() if "| canopen |" in line]
    assert canopen[0].endswith("| 1 | 1 |")


def test_a_failed_client_ends_it_with_1_and_stands_in_the_table(tmp_path: Path) -> None:
    page = tmp_path / "mocks.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    assert clients.main(lambda: REPORT, page) == 1
    text = page.read_text()
    assert text.startswith(f"before\n{BEGIN}\n\n| mock |")
    assert text.endswith(f"\n{END}\nafter\n")
    assert "old" not in text
    assert clients.main(lambda: REPORT.replace("<failure/>", "").replace("<skipped/>", ""), page) == 0
    assert clients.main(lambda: "<testsuites/>", page) == 1


def test_a_page_without_a_place_for_it_is_told() -> None:
    with pytest.raises(ValueError, match="no place for the table"):
        clients.written("nothing here", "table")


# Modules that tests of mocks import and that are no client: what tests are made with.
NO_CLIENTS = {"serial", "pytest", "hypothesis", "numpy", "scipy", "pydantic"}


@cache
def distributions() -> Mapping[str, list[str]]:
    return packages_distributions()


def clients_in(source: str) -> set[str]:
    """Distributions that the imports of a test file bring in."""
    named = {
        name.partition(".")[0]
        for node in ast.walk(ast.parse(source))
        for name in (
            [alias.name for alias in node.names] if isinstance(node, ast.Import)
            else [node.module or ""] if isinstance(node, ast.ImportFrom)
            else []
        )
    } - NO_CLIENTS - sys.stdlib_module_names  # fmt: skip
    known = distributions()
    return {known[name][0].lower().replace("_", "-") for name in named if name in known}


def test_every_client_that_a_test_of_a_mock_uses_is_in_the_table() -> None:
    used = {
        (str(file.relative_to(ROOT / TESTS)), distribution)
        for file in (ROOT / TESTS).rglob("test_*.py")
        for distribution in clients_in(file.read_text())
    }
    assert used - {(client.file, client.distribution) for client in CLIENTS} == set()
    assert len(used) >= 9


def test_a_client_is_seen_however_it_is_imported() -> None:
    ways = ("import pymodbus", "from pymodbus.client import X")
    assert [clients_in(way) for way in ways] == [{"pymodbus"}] * 2
    assert clients_in("import os, pytest\nfrom drivers import crc\nfrom tests import x") == set()


def test_the_page_has_as_many_tests_of_each_client_as_there_are_and_all_passed() -> None:
    files = sorted({f"{TESTS}/{client.file}" for client in CLIENTS})
    collected = subprocess.run(
        [sys.executable, "-m", "pytest", "--collect-only", "-q", *files],
        cwd=ROOT, capture_output=True, text=True, timeout=100, check=True,
    ).stdout  # fmt: skip
    seen = []
    for line in collected.splitlines():
        path, separator, name = line.partition("::")
        if separator:
            seen.append(Outcome(path.removeprefix(f"{TESTS}/"), name.rpartition("::")[2], True))
    expected = re.sub(r"\| [^|]+ (?=\| \d+ \| \d+ \|)", "| VERSION ", clients.table(seen))
    shown = PAGE.read_text().partition(BEGIN)[2].partition(END)[0].strip()
    assert re.sub(r"\| [^|]+ (?=\| \d+ \| \d+ \|)", "| VERSION ", shown) == expected.strip()
