"""``python -m tools.clients``: runs the tests in which clients of others talk to the mocks, and writes their table.

The table of `docs/reference/mocks.md` is made of what passed and failed in this run, with the versions of the clients.
It ends with 1 where a test failed.
"""

import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/reference/mocks.md"
BEGIN, END = "<!-- clients: made by python -m tools.clients -->", "<!-- clients end -->"
HEAD = "| mock | client | version | tests passed | failed or skipped |\n| --- | --- | --- | --- | --- |\n"
TESTS = "tests/mock_devices"


class Client(NamedTuple):
    """One client of others: the mock it talks to, its distribution, and which tests run it, by file and name."""

    mock: str
    distribution: str
    file: str
    named: str
    pinned: str = ""


CLIENTS = (
    Client("maxon EPOS4", "python-can", "epos4/test_clients.py", "python_can_"),
    Client("maxon EPOS4", "canopen", "epos4/test_clients.py", "test_canopen_"),
    Client("maxon EPOS4", "canopen", "epos4/test_being.py", "python_canopen_reads_every_object"),
    Client("maxon EPOS4", "canopen (npm)", "epos4/test_npm_canopen.py", "npm_canopen", "6.2.1"),
    Client("maxon EPOS4", "being", "epos4/test_being.py", "its_own_classes", "1.0.2"),
    Client("CiA 402 drive", "canopen", "cia402/test_clients.py", "test_canopen_"),
    Client("NDI Polaris, Vega", "ndicapi", "ndi/test_clients.py", "test_ndicapi_"),
    Client("NDI Polaris, Vega", "scikit-surgerynditracker", "ndi/test_clients.py", "test_scikit_surgery_"),
    Client("Bota SensONE", "pyserial", "bota/test_opening.py", "client"),
    Client("Bota SensONE", "bota-driver", "bota/test_bota_driver.py", "test_bota_driver_"),
    Client("Robotiq FT 300", "pymodbus", "robotiq/test_mock.py", "test_pymodbus_"),
    Client("Robotiq FT 300", "minimalmodbus", "robotiq/test_mock.py", "test_minimalmodbus_"),
    Client("Robotiq FT 300", "mbpoll", "robotiq/test_mock.py", "test_mbpoll_", "Debian's"),
    Client("LAUMAS TLB", "pymodbus", "laumas/test_clients.py", "test_pymodbus_"),
    Client("LAUMAS TLB", "minimalmodbus", "laumas/test_clients.py", "test_minimalmodbus_"),
    Client("LAUMAS TLB", "mbpoll", "laumas/test_clients.py", "test_mbpoll_", "Debian's"),
    Client("ATI Net F/T, of the example plug-in", "pynetft", "netft/test_clients.py", "test_pynetft_"),
    Client("ATI Net F/T, of the example plug-in", "netft", "netft/test_clients.py", "test_netft_"),
    Client("Zaber axis", "zaber-motion", "zaber/test_clients.py", "test_zaber_motion_"),
    Client("OptiTrack Motive", "natnet", "optitrack/test_clients.py", "test_natnet_"),
    Client("OpenIGTLink server", "pyigtl", "openigtlink/test_clients.py", "pyigtl"),
    Client("Glove, StandardFirmata", "pyfirmata2", "firmata/test_with_pyfirmata2.py", "test_pyfirmata2_"),
)


class Outcome(NamedTuple):
    """How one test ended."""

    file: str
    name: str
    passed: bool


def outcomes(report: str) -> list[Outcome]:
    """Every test of a JUnit report."""
    cases = ElementTree.fromstring(report).iter("testcase")
    return [
        Outcome(_file_of(case.get("classname", "")), case.get("name", ""), not len(case.findall("*"))) for case in cases
    ]


def _file_of(module: str) -> str:
    """The file of a dotted module, which a class may follow."""
    path = re.sub(r"(\.Test\w+)+$", "", module).replace(".", "/")
    return f"{path}.py".removeprefix(f"{TESTS}/")


def belongs(client: Client, outcome: Outcome) -> bool:
    """Whether the test runs this client."""
    return outcome.file == client.file and client.named in outcome.name


def row(client: Client, seen: Iterable[Outcome]) -> str:
    """The client's line of the table."""
    mine = [outcome for outcome in seen if belongs(client, outcome)]
    passed = sum(outcome.passed for outcome in mine)
    release = client.pinned or _release(client.distribution)
    return f"| {client.mock} | {client.distribution} | {release} | {passed} | {len(mine) - passed} |\n"


def _release(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"


def table(seen: list[Outcome]) -> str:
    """All clients."""
    return HEAD + "".join(row(client, seen) for client in CLIENTS)


def written(page: str, lines: str) -> str:
    """The page with its table replaced; ValueError where it has no place for one."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"no place for the table: {BEGIN} ... {END}")
    return f"{before}{BEGIN}\n\n{lines}\n{END}{after}"


def run_tests() -> str:
    """Runs them one after another and gives the report."""
    files = sorted({f"{TESTS}/{client.file}" for client in CLIENTS})
    wanted = " or ".join(sorted({client.named for client in CLIENTS}))
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        command = [sys.executable, "-m", "pytest", "-q", "-k", wanted, f"--junitxml={report}", *files]
        subprocess.run(command, cwd=ROOT, check=False)
        return report.read_text()


def main(run: Callable[[], str] = run_tests, page: Path = PAGE) -> int:
    """Runs the tests and writes the table."""
    seen = [outcome for outcome in outcomes(run()) if any(belongs(client, outcome) for client in CLIENTS)]
    page.write_text(written(page.read_text(), table(seen)))
    return int(not seen or not all(outcome.passed for outcome in seen))


if __name__ == "__main__":
    sys.exit(main())
