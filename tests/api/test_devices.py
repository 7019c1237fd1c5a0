"""`rig devices` and `rig find`: what there is, what failed, and that no port is written to without consent."""

import json
import os
import pty
import select
import subprocess
import sys
import tomllib
import tty
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo
from typer.testing import CliRunner

from api.cli.app import build
from api.cli.hardware import _lines
from api.cli.mock_bench import at_endpoints
from api.cli.options import built_in
from api.http import app as service
from api.http.service import Service
from api.operations.devices import _unusable, devices
from controller.devices import finding
from drivers.roles import Device
from mock_devices.testing.access import client_of
from mock_devices.testing.commands import RIG, ROOT, ServedBench, served_bench
from rig import plugins
from rig.channels import ForceSample
from rig.config.endpoints import Endpoints
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.registry import AXES, ROLES, name_of
from rig.config.wiring import Wiring
from rig.errors import DeviceError, UsageError
from rig.plugins import Plugin
from rig.results.devices import DevicesResult, FindResult, PortFound


def rig(*arguments: str | Path) -> Any:
    return CliRunner().invoke(build(str(arguments[0])), [*map(str, arguments)])


def test_every_product_is_listed_with_its_options(tmp_path: Path) -> None:
    said = rig("devices", "robotiq-ft300", "--json", tmp_path / "devices.json")
    assert said.exit_code == 0, said.output
    result = DevicesResult.read(tmp_path / "devices.json")
    (found,) = result.products
    assert (found.role, found.distribution, found.rate_Hz, found.simulated) == ("force", "tissue-rig", 100.0, True)
    options = {option.key: (option.value, option.default) for option in found.options}
    assert options["baud"] == ("`0`, `19200`", "0")
    assert "force.baud" in said.output


def test_inputs_are_products_like_any_other() -> None:
    found = {one.product: one for one in devices().products if one.role == "input"}
    assert {name: one.rate_Hz for name, one in found.items()} == {
        "firmata-glove": 50.0, "evdev-switch": None, "lsl-stream": 50.0,
    }  # fmt: skip
    said = rig("devices", "evdev-switch")
    assert said.exit_code == 0 and "input.NAME.stops" in said.output


def test_of_an_axis_no_rate_is_promised() -> None:
    rates = {one.product: one.rate_Hz for one in devices().products}
    assert (rates["maxon-epos4"], rates["ndi-polaris"], rates["bota-sensone"]) == (None, 60.0, 1000.0)


def test_an_unknown_product_is_answered_with_the_nearest() -> None:
    with pytest.raises(UsageError, match="unknown product 'bota'; nearest valid product: bota-sensone"):
        devices("bota")


def test_help_says_which_keys_a_product_has(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "300")
    assert "increments_per_rev" in rig("devices", "--help").output


def test_the_service_says_the_same(tmp_path: Path) -> None:
    bench = Service(Wiring(), tmp_path / "sessions", tmp_path / "protocols")
    with client_of(bench) as client:
        answer = client.get("/api/v1/devices")
    assert DevicesResult.model_validate(answer.json()) == devices()
    assert "/api/v1/devices" in service.build(bench).openapi()["paths"]


def planted(folder: Path) -> dict[str, str]:
    """Three distributions of one group: one whose import fails, and two that declare one name."""
    for name, line in (("broken", "broken_plug:X"), ("one", "twin_plug:Twin"), ("two", "twin_plug:Twin")):
        about = folder / f"{name}-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (about / "entry_points.txt").write_text(f"[tissue_rig.force]\n{name} = {line}\n")
    (folder / "broken_plug.py").write_text("raise RuntimeError('no licence')\n")
    (folder / "twin_plug.py").write_text(
        "from typing import ClassVar, Literal\nfrom pydantic import Field\n"
        "from rig.config.products.roles import ForceProduct\n"
        "class Twin(ForceProduct):\n    'One of two.'\n"
        "    driver: ClassVar[str] = 'x:y'\n    advice: ClassVar[str] = 'force.port'\n"
        "    range_N: ClassVar[float] = 1.0\n    range_N_m: ClassVar[float] = 1.0\n"
        "    product: Literal['twin'] = Field(default='twin', description='x')\n"
    )
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)]), "COLUMNS": "300"}


def test_plug_ins_that_fail_are_listed_and_harm_no_command(tmp_path: Path) -> None:
    environment = planted(tmp_path)

    def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            [*RIG, *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60, check=False
        )

    assert run("devices", "--json", "all.json").returncode == 0
    found = json.loads((tmp_path / "all.json").read_text())
    assert {one["distribution"]: one["error"] for one in found["plugins"] if one["group"] == "tissue_rig.force"} == {
        "broken": "RuntimeError: no licence",
        "one": "2 plug-ins declare 'twin'; uninstall others",
        "two": "2 plug-ins declare 'twin'; uninstall others",
    }
    assert {one["product"] for one in found["products"]} == {one.product for one in devices().products}
    said = run("doctor", "--set", "force.product=twin")
    assert said.returncode == 2
    assert "unknown product 'twin'" in said.stderr and "tissue_rig.force 'one' of one 1.0: 2 plug-ins" in said.stderr
    assert "Traceback" not in said.stderr


HOLLOW = """
from typing import ClassVar, Literal
from pydantic import Field
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.roles import MockPort

class Hollow(BotaWiring):
    "Its driver and its mock lack what they need."
    driver: ClassVar[str] = "hollow_plug:Driver"
    mock: ClassVar[MockPort | None] = MockPort("hollow_mock:make", "hollow")
    product: Literal["hollow"] = Field(default="hollow", description="x")

class Annotated(Hollow):
    "Its driver comes from a function that says what it gives; its mock is not there."
    driver: ClassVar[str] = "hollow_plug:opened"
    mock: ClassVar[MockPort | None] = MockPort("hollow_mock:nobody", "hollow")
    product: Literal["annotated"] = Field(default="annotated", description="x")

class Driver:
    def __init__(self, config): ...
    def start(self): ...
    def fileno(self): return 0
    def poll(self, now_ns): return []

def opened(config) -> Driver:
    return Driver(config)
"""
HOLLOW_MOCK = """
from mock_devices.played import MockDevice

class Mock:
    def endpoints(self): return {"serial": "/dev/null"}
    def filenos(self): return []

def make(factory):
    return [MockDevice("hollow", Mock(), factory.faulty(factory.line("hollow")), {})]
"""


@pytest.fixture(scope="module")
def hollow(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    folder = tmp_path_factory.mktemp("site")
    about = folder / "acme-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(
        "[tissue_rig.force]\nhollow = hollow_plug:Hollow\nannotated = hollow_plug:Annotated\n"
    )
    (folder / "hollow_plug.py").write_text(HOLLOW)
    (folder / "hollow_mock.py").write_text(HOLLOW_MOCK)
    return folder, os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), str(ROOT)]), "COLUMNS": "300"}


def run_beside(hollow: tuple[Path, dict[str, str]], *command: str) -> "subprocess.CompletedProcess[str]":
    folder, environment = hollow
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip


def test_a_plug_in_without_what_its_role_has_is_listed_with_what_it_lacks(hollow: tuple[Path, dict[str, str]]) -> None:
    assert run_beside(hollow, *RIG, "devices", "--json", "all.json").returncode == 0
    found = json.loads((hollow[0] / "all.json").read_text())
    assert {one["declares"]: one["error"] for one in found["plugins"]} == {
        "hollow": "its driver has no close, which ForceSensor has",
        "annotated": "AttributeError: module 'hollow_mock' has no attribute 'nobody'",
    }


@pytest.mark.parametrize(
    ("chosen", "code", "said"),
    [
        ((), 0, ("tissue_rig.force 'hollow' of acme 1.0: its mock cannot be played: it has no close, no due_ns,",
                 "tissue_rig.force 'annotated' of acme 1.0: its mock cannot be played: AttributeError")),
        (("--force", "hollow"), 1, ("'hollow' of acme 1.0: its mock cannot be played: it has no close, no due_ns,",)),
        (("--force", "bota-sensone"), 0, ()),
    ],
    ids=["all", "itself", "ours"],
)  # fmt: skip
def test_a_mock_that_lacks_what_a_mock_needs_is_named_and_harms_no_other(
    chosen: tuple[str, ...], code: int, said: tuple[str, ...], hollow: tuple[Path, dict[str, str]]
) -> None:
    command = (sys.executable, "-m", "mock_devices.serve", "--with-parent", "--tracker-tcp-port", "0", *chosen)
    served = run_beside(hollow, *command)
    assert served.returncode == code, served.stderr
    assert all(sentence in served.stderr for sentence in said) and "Traceback" not in served.stderr
    assert ('"force"' in served.stdout) is (code == 0)


class Twelve:
    """No driver."""


class Base(ABC):
    """Of a maker's drivers."""

    @abstractmethod
    def poll(self, now_ns: int) -> Sequence[ForceSample]: ...


def unresolved(config: object) -> "OnlyForTypeCheckers": ...  # type: ignore[name-defined] # noqa: F821
def of_a_role(config: object) -> Device: ...  # type: ignore[empty-body]
def of_a_base(config: object) -> Base: ...  # type: ignore[empty-body]
def hollow_one(config: object) -> Twelve: ...  # type: ignore[empty-body]


bound = partial(of_a_role, None)


@pytest.mark.parametrize(
    ("driver", "said"),
    [("unresolved", ""), ("of_a_role", ""), ("of_a_base", ""), ("bound", ""),
     ("hollow_one", "its driver has no close, no fileno, no poll, no start, which ForceSensor has")],
)  # fmt: skip
def test_a_driver_is_listed_as_broken_only_where_what_it_returns_is_known(driver: str, said: str) -> None:
    product = type("Given", (BotaWiring,), {"driver": f"{__name__}:{driver}", "mock": None})
    assert _unusable("force", product) == said


@pytest.fixture
def line() -> Iterator[tuple[int, str]]:
    """A serial line with somebody else's device at its far end."""
    far, near = pty.openpty()
    tty.setraw(near)
    yield far, os.ttyname(near)
    os.close(far)
    os.close(near)


def test_without_consent_nothing_is_written_to_any_port(
    line: tuple[int, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    far, near = line
    port = ListPortInfo(near, skip_link_detection=True)
    port.vid, port.pid, port.manufacturer, port.product, port.serial_number = (
        0x16D0,
        0x117E,
        "Openlight",
        "CANable2",
        "7",
    )
    monkeypatch.setattr(list_ports, "comports", lambda: [port])
    for others in ("buses", "switches", "streams"):  # of this computer, on which other tests may be sending
        monkeypatch.setattr(finding, others, list)
    said = rig("find", "--json", tmp_path / "found.json")
    assert said.exit_code == 0, said.output
    (found,) = FindResult.read(tmp_path / "found.json").ports
    assert (found.usb, found.kind, found.asked) == ("16d0:117e Openlight CANable2 7", "CANable, CAN by SLCAN", False)
    assert not select.select([far], [], [], 0.2)[0]


def test_where_nothing_is_found_the_next_step_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    port = ListPortInfo("/dev/ttyUSB7", skip_link_detection=True)
    port.vid, port.pid = 0x16D0, 0x117E
    for others in ("buses", "switches", "streams"):
        monkeypatch.setattr(finding, others, list)
    for there in ([], [port]):
        monkeypatch.setattr(list_ports, "comports", there.copy)
        said = rig("find")
        assert said.exit_code == 0, said.output
        assert ("plug it in, or name its port" in " ".join(said.output.split())) == (not there)


def test_consent_is_asked_for_each_port_and_a_no_is_kept() -> None:
    asked = []

    def consent(port: PortFound) -> bool:
        asked.append(port.address)
        return False

    seen = [finding.named("/dev/null"), finding.named("tcp://127.0.0.1:1")]
    assert list(finding.find(seen, consent)) == seen
    assert asked == ["/dev/null", "tcp://127.0.0.1:1"]


def test_where_nobody_answers_each_product_was_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    tried = []

    def refused(role: str, product: type, address: str) -> None:
        tried.append(role)
        raise DeviceError("silent")

    monkeypatch.setattr(finding, "_identity", refused)
    found = finding.ask(finding.named("/dev/ttyUSB9"))
    assert found.asked and "the last said: silent" in found.problem
    assert tried == [role for role, _ in finding.candidates()]


def named_at(usb: str) -> list[str]:
    return [name_of(product) for _, product in finding.candidates(usb)]


CAN_PRODUCTS = ["maxon-epos4", "cia402"]


@pytest.mark.parametrize(
    ("usb", "products"),
    [
        ("16d0:117e Openlight CANable2 7", CAN_PRODUCTS),
        ("0403:ffa8 LAWICEL CANUSB", CAN_PRODUCTS),
        ("ad50:60c4 CANable", CAN_PRODUCTS),
        ("2341:0043 Arduino (www.arduino.cc) 95", ["firmata-glove"]),
    ],
)
def test_an_adapter_that_is_known_is_asked_for_what_stands_behind_it_alone(
    usb: str, products: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ids of usb.ids and of their makers; nothing of a force sensor's or tracker's is written to a CAN adapter."""
    tried = []

    def refused(role: str, product: Any, address: str) -> None:
        tried.append(name_of(product))
        raise DeviceError("silent")

    monkeypatch.setattr(finding, "_identity", refused)
    port = PortFound(address="/dev/ttyACM0", usb=usb, kind="", asked=False)
    assert f"no device of {len(products)} products answers" in finding.ask(port).problem
    assert tried == products


def test_behind_an_adapter_of_nobody_every_product_is_looked_for_and_those_with_their_own_last() -> None:
    every = named_at("")
    assert set(named_at("0403:6001 FTDI FT232R A1")) == set(every) and len(every) > len(CAN_PRODUCTS) + 1
    assert named_at("0403:6001 FTDI FT232R A1")[-3:] == [*CAN_PRODUCTS, "firmata-glove"]


def test_a_plug_in_is_asked_behind_every_adapter_as_nobody_knows_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    theirs = Plugin("tissue_rig.force", "x", "acme", "1.0", "bota-sensone")
    monkeypatch.setattr(plugins, "_met", {"tissue_rig.force": (theirs,)})
    assert named_at("16d0:117e Openlight CANable2 7") == [*CAN_PRODUCTS, "bota-sensone"]


def test_asking_where_nobody_can_answer_says_the_option() -> None:
    said = rig("find", "/dev/ttyUSB9", "--ask")
    assert isinstance(said.exception, UsageError) and "no terminal to answer at; give --yes" in str(said.exception)
    both = rig("find", "--ask", "--yes")
    assert isinstance(both.exception, UsageError)


def event_device(names: Path, node: str, name: str, keys: str) -> None:
    device = names / node / "device"
    (device / "capabilities").mkdir(parents=True)
    (device / "name").write_text(f"{name}\n")
    (device / "capabilities/key").write_text(f"{keys}\n")


def test_foot_switches_are_found_by_their_names_and_never_opened(tmp_path: Path) -> None:
    event_device(tmp_path, "event0", "PCsensor FootSwitch", "1000000000007 ff800000000007ff febeffdff3cfffff")
    event_device(tmp_path, "event1", "PCsensor FootSwitch", "10000 0 0 0 0")
    event_device(tmp_path, "event2", 'Lid "Switch"', "0 0")
    (found,) = finding.switches(tmp_path)
    assert (found.role, found.product, found.address, found.asked) == (
        "input", "evdev-switch", "name:PCsensor FootSwitch", False,
    )  # fmt: skip
    assert found.lines == '[input.switch]\nproduct = "evdev-switch"\nport = "name:PCsensor FootSwitch"\n'
    assert list(finding.find([found], lambda _: pytest.fail("what names itself is not asked"))) == [found]


def written(folder: Path, **files: str) -> None:
    folder.mkdir(parents=True)
    for name, text in files.items():
        (folder / name).write_text(f"{text}\n")


def test_can_buses_are_found_as_linux_or_python_can_drives_them(tmp_path: Path) -> None:
    """As /sys of a computer with one bus of the kernel, whose adapter counts once, and three adapters without."""
    for name, kind in (("lo", "772"), ("eth0", "1"), ("can0", "280")):
        written(tmp_path / "class" / "net" / name, type=kind)
    plugged = (("1-1", "0c72", "000c"), ("1-2", "0c72", "000c"), ("1-3", "1d50", "606f"), ("1-4", "0403", "6001"))
    for place, vendor, product in (*plugged, ("2-1", "0c72", "000c")):
        written(tmp_path / "bus" / "usb" / "devices" / place, idVendor=vendor, idProduct=product)
    (tmp_path / "bus" / "usb" / "devices" / "1-1" / "1-1:1.0" / "net" / "can0").mkdir(parents=True)
    assert [(bus.address, bus.usb) for bus in finding.buses(tmp_path)] == [
        ("can0", ""), ("PCAN_USBBUS1", "0c72:000c"), ("PCAN_USBBUS2", "0c72:000c"), ("0", "1d50:606f"),
    ]  # fmt: skip


@pytest.mark.parametrize("address", ["can0", "PCAN_USBBUS1", "0"])
def test_the_lines_of_a_bus_are_those_of_an_axis_and_nobody_writes_to_it(address: str, tmp_path: Path) -> None:
    written(tmp_path / "class" / "net" / "can0", type="280")
    for place, vendor, product in (("1-2", "0c72", "000c"), ("1-3", "1d50", "606f")):
        written(tmp_path / "bus" / "usb" / "devices" / place, idVendor=vendor, idProduct=product)
    (bus,) = [one for one in finding.buses(tmp_path) if one.address == address]
    assert list(finding.find([bus], lambda _: pytest.fail("asked"))) == [bus]
    table = {"product": "maxon-epos4", **tomllib.loads(bus.lines)["axis"]}
    assert Wiring.model_validate({"axis": table}).axis.port == address
    assert bus.lines.endswith("# increments_per_mm = ...  (of your screw and gear)\n")


def test_the_lines_of_a_bus_state_the_rate_that_it_is_set_to(tmp_path: Path) -> None:
    written(tmp_path / "class" / "net" / "can0", type="280")
    said = '[{"linkinfo":{"info_kind":"can","info_data":{"bittiming":{"bitrate":500000}}}}]'
    (bus,) = finding.buses(tmp_path, lambda name: said if name == "can0" else "")
    assert tomllib.loads(bus.lines)["axis"] == {"interface": "socketcan", "port": "can0", "bitrate": 500_000}


@pytest.mark.parametrize(("scale", "direction"), [(1000.0, None), (-1000.0, -1)])
def test_the_lines_of_a_mock_bench_have_the_scale_of_its_own_carriage(scale: float, direction: int | None) -> None:
    mocks = [product.mock for products in ROLES.values() for product in products.values() if product.mock]
    known = {"control": "c", "pid": 1, "serials": {}, "latency_ms": {}}
    every = {mock.role: {one.kind: "/dev/a" for one in mocks if one.role == mock.role} for mock in mocks}
    lines = _lines(Endpoints.model_validate(known | every), scale)
    (said,) = [tomllib.loads(line) for line in lines.splitlines() if "increments" in line and "maxon-epos4" in line]
    assert said == {"axis": {"increments_per_mm": 1000}}
    assert ("axis.direction = -1" in lines) is (direction == -1)


@pytest.mark.parametrize(("product", "asked"), [("maxon-epos4", True), ("zaber-ascii", True), ("cia402", False)])
def test_the_lines_of_an_axis_say_that_a_scale_belongs_there(product: str, asked: bool) -> None:
    lines = finding.lines_of("axis", AXES[product], "/dev/a")
    assert lines.endswith("# increments_per_mm = ...  (of your screw and gear)\n") is asked
    assert tomllib.loads(lines)["axis"] == {"product": product, "port": "/dev/a"}


@pytest.mark.parametrize("installed", [True, False])
def test_streams_are_found_where_the_extra_is_installed(installed: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(finding, "find_spec", lambda _: object() if installed else None)
    monkeypatch.setattr(finding, "streams_there", lambda: [("belt", "Respiration")])
    found = [(one.address, one.kind, one.lines) for one in finding.streams()]
    line = '[input.breathing]\nproduct = "lsl-stream"\nport = "belt"\n'
    assert found == ([("belt", "stream of kind Respiration", line)] if installed else [])


def test_a_glove_is_looked_for_at_lines_and_what_has_no_line_is_not() -> None:
    asked = [product for role, product in finding.candidates() if role == "input"]
    assert [product.__name__ for product in asked] == ["FirmataGlove"]


@pytest.fixture(scope="module")
def bench() -> Iterator[ServedBench]:
    with served_bench("--seed", "1", "--input", "firmata-glove", "--input", "lsl-stream") as served:
        yield served


@pytest.mark.bench
@pytest.mark.extra
@pytest.mark.xdist_group("commands")
@pytest.mark.by_hand
def test_glove_and_stream_of_the_mock_bench_are_found(bench: ServedBench) -> None:
    ports = bench.endpoints.devices
    glove = finding.ask(finding.named(ports["glove"]["serial"]))
    assert (glove.role, glove.product, glove.lines.partition("\n")[0]) == ("input", "firmata-glove", "[input.glove]")
    assert ports["breathing"]["lsl"] in [stream.address for stream in finding.streams()]


PLAYED = {name_of(product): role for role, product in finding.candidates() if product.mock and role != "input"}


@pytest.mark.bench
@pytest.mark.extra
@pytest.mark.xdist_group("commands")
@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", PLAYED)
def test_each_product_that_can_be_played_is_found_at_its_port_and_no_other_is(name: str, bench: ServedBench) -> None:
    """Whatever was asked before it, and what that wrote to it, it is there and answers for itself."""
    role = PLAYED[name]
    wired = at_endpoints(built_in([f"{role}.product={name}"]), bench.endpoints)
    device = getattr(wired, role)
    address, mock = device.port, device.mock.role
    found = finding.ask(finding.named(address))
    assert (found.role, found.product, found.problem) == (role, name, "")
    assert found.serial == bench.endpoints.serials.get(mock, found.serial)
    assert found.lines.startswith(f'[{role}]\nproduct = "{name}"\nport = "{address}"\n')
