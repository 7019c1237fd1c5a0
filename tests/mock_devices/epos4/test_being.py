"""`being` 1.0.2, unchanged, with the maker's own data sheet that it carries, against the drive mock.

Its requirements contradict the ones of this project, so that it is not locked: it is installed beside, without them,
into a folder of this run. The data sheet is the maker's and stays there.
"""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import canopen
import pytest

from drivers.cia402.eds import read_eds
from drivers.cia402.kind import check_sheet
from drivers.cia402.units import units_per_turn
from drivers.epos4.node import Node
from drivers.epos4.objects import TEXT, Entry
from mock_devices.epos4.table import EPOS4, LATER
from mock_devices.testing.epos4 import remote_drive
from mock_devices.testing.remote import RemoteMock
from rig.errors import UsageError
from tests.lacking import lacking

pytestmark = [pytest.mark.extra, pytest.mark.bench, pytest.mark.xdist_group("commands")]
PACKAGES = ("being==1.0.2", "ruamel.yaml==0.18.16", "tomlkit==0.13.3", "configobj==5.0.9")
UV = Path(sys.executable).with_name("uv")
# Types of CiA 301 by the letter under which our table has them; octets and text have neither length nor letter.
CIA_301 = {"B": 5, "H": 6, "I": 7, "b": 2, "h": 3, "i": 4, "?": 1, "Q": 0x1B}
SESSION = """
import json, sys, time, warnings
warnings.simplefilter("ignore")
from being.backends import CanBackend
from being.can import load_object_dictionary
from being.can.cia_402 import CiA402Node, OperationMode, State
from being.motors.controllers import Epos4
from being.motors.motors import get_motor

PATIENCE_S = 10
result = {"states": []}

def until(done, step=lambda: time.sleep(0.02)):
    end = time.monotonic() + PATIENCE_S
    while not done() and time.monotonic() < end:
        step()

with CanBackend(bitrate=1_000_000, bustype="slcan", channel=sys.argv[1]) as net:
    result["nodes"] = net.scan_for_node_ids()
    dictionary = load_object_dictionary(net, 1)
    node = CiA402Node(1, dictionary, net)
    net.enable_pdo_communication()
    for target in (State.OPERATION_ENABLED, State.READY_TO_SWITCH_ON):
        result["states"].append(node.change_state(target, timeout=PATIENCE_S).name)
    node.set_operation_mode(OperationMode.PROFILE_POSITION)
    node.enable(timeout=PATIENCE_S)
    node.move_to(4000, velocity=500, acceleration=5000)
    until(lambda: abs(node.sdo[0x6064].raw - 4000) <= 20)
    result["profile"] = node.sdo[0x6064].raw
    node.disable(timeout=PATIENCE_S)
    result["modes"] = []
    for mode in (3, 6, 8, 9, 10):
        node.set_operation_mode(OperationMode(mode))
        result["modes"].append(int(node.get_operation_mode()))
    axis = Epos4(node, get_motor("EC45"), 20.0)
    axis.enable()
    result["inputs"] = [node.sdo[0x3142][number].raw for number in range(1, 9)]
    result["firmware"] = axis.firmware_version()

    def turn(target=None):
        axis.update()
        if target is not None:
            axis.set_target_position(target)
        net.transmit_all_rpdos()
        net.send_sync()
        time.sleep(0.005)

    for _ in range(60):
        turn()
    axis.home()
    until(lambda: axis.homing_state().name == "HOMED", turn)
    result["homing"] = axis.homing_state().name
    until(lambda: abs(axis.get_actual_position() - 4.0) < 0.01, lambda: turn(4.0))
    result["position"] = axis.get_actual_position()
    result["errors"] = list(axis.error_history_messages())
    axis.disable()
    for _ in range(60):
        turn()
print(json.dumps(result))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where it is installed."""
    folder = tmp_path_factory.mktemp("being")
    command = [
        str(UV),
        "pip",
        "install",
        "--quiet",
        "--python",
        sys.executable,
        "--no-deps",
        "--target",
        str(folder),
        *PACKAGES,
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=110, check=False)
    if done.returncode:
        lacking(f"being cannot be installed here: {done.stderr.strip().splitlines()[-1:]}")
    return folder


@pytest.fixture(scope="module")
def sheet(folder: Path) -> Path:
    """The maker's data sheet."""
    return folder / "being/can/eds_files/maxon_EPOS4_50-5.eds"


@pytest.fixture
def mock() -> Iterator[RemoteMock]:
    with remote_drive() as mock:
        yield mock


def variables(sheet: Path) -> dict[tuple[int, int], Any]:
    """Every entry of the data sheet as python canopen reads it, of node 1."""
    dictionary = canopen.import_od(str(sheet), node_id=1)
    found: dict[tuple[int, int], Any] = {}
    for index in dictionary:
        item = dictionary[index]
        members = {0: item} if isinstance(item, canopen.objectdictionary.ODVariable) else item
        found |= {(index, sub): members[sub] for sub in members}
    return found


def test_the_table_agrees_with_the_makers_sheet_entry_by_entry(sheet: Path) -> None:
    theirs = variables(sheet)
    assert len(theirs) == 443
    assert EPOS4.objects.keys() - theirs.keys() == {(entry.index, entry.sub) for entry in LATER}
    assert theirs.keys() - EPOS4.objects.keys() == set()
    for key, variable in theirs.items():
        entry = EPOS4.objects[key]
        assert (entry.kind == TEXT) is (variable.data_type not in CIA_301.values()), entry
        assert entry.kind == TEXT or variable.data_type == CIA_301[entry.kind], entry
        assert (entry.access[-1] == "+") is variable.pdo_mappable, entry
        assert entry.access.removesuffix("+") == {"rww": "rw"}.get(variable.access_type, variable.access_type), entry
        default = int(entry.default) + (1 if entry.by_node else 0)
        assert entry.kind == TEXT or (variable.default or 0) == default, entry


# Of two makers: entries, vendor, product, name.
SHEETS = {
    "maxon_EPOS4_50-5.eds": (443, 0xFB, 0x61500000, "EPOS4 Module 50/5"),
    "MCLM3002P-CO.eds": (275, 327, 3150, "MCLM300...CO"),
}


@pytest.mark.parametrize("name", SHEETS)
def test_our_reader_reads_the_makers_sheet_as_canopen_does(name: str, folder: Path) -> None:
    path = folder / "being/can/eds_files" / name
    ours, theirs = read_eds(path), variables(path)
    assert ours.objects.keys() == theirs.keys()
    assert (len(theirs), ours.vendor, ours.product, ours.name) == SHEETS[name]
    for key, variable in theirs.items():
        entry = ours.objects[key]
        assert (entry.kind == TEXT) is (variable.data_type not in CIA_301.values()), entry
        assert entry.kind == TEXT or variable.data_type == CIA_301[entry.kind], entry
        assert entry.kind == TEXT or int(entry.default) + entry.by_node == (variable.default or 0), entry
        assert entry.access.removesuffix("+") == {"rww": "rw", "rwr": "rw"}.get(
            variable.access_type, variable.access_type
        )
        assert (entry.access[-1] == "+") is variable.pdo_mappable, entry


class AsDelivered:
    """A drive that has what its sheet says."""

    name = "MCLM"

    def __init__(self, theirs: dict[tuple[int, int], Any]) -> None:
        self._theirs = theirs

    def read(self, entry: Entry) -> int:
        return int(self._theirs[entry.index, entry.sub].default)

    def has(self, entry: Entry) -> bool:
        return (entry.index, entry.sub) in self._theirs

    def ratio(self, index: int) -> float:
        return float(self._theirs[index, 1].default / self._theirs[index, 2].default)


def test_a_drives_factors_give_the_scale_that_its_makers_own_position_factor_gives(folder: Path) -> None:
    """Object 6093, which we do not read, says increments for a unit; those for a turn are of encoder and gear."""
    drive = AsDelivered(variables(folder / "being/can/eds_files/MCLM3002P-CO.eds"))
    per_turn = drive.ratio(0x608F) * drive.ratio(0x6091) / drive.ratio(0x6093)
    assert units_per_turn(cast(Node, drive), drive.has) == pytest.approx(per_turn) == 1000.0


def test_a_servo_drive_without_what_a_bench_needs_is_refused_by_its_sheet(folder: Path) -> None:
    sheet = read_eds(folder / "being/can/eds_files/MCLM3002P-CO.eds")
    with pytest.raises(UsageError, match=r"MCLM: lacks object 6007:00 \(abort connection option code\), which an axis"):
        check_sheet(sheet, "MCLM")


def test_python_canopen_reads_every_object_of_the_sheet(sheet: Path, mock: RemoteMock) -> None:
    network = canopen.Network()
    network.connect(interface="slcan", channel=mock.address, bitrate=1_000_000, sleep_after_open=0, timeout=0.01)
    try:
        node = network.add_node(1, str(sheet))
        node.sdo.RESPONSE_TIMEOUT = 10.0
        for (index, sub), variable in variables(sheet).items():
            if variable.access_type == "wo":
                with pytest.raises(canopen.SdoAbortedError) as refused:
                    node.sdo.upload(index, sub)
                assert refused.value.code == 0x06010001
                continue
            data = node.sdo.upload(index, sub)
            kind = EPOS4.objects[index, sub]
            assert kind.kind == TEXT or len(data) == kind.size, f"{index:04X}:{sub:02X}"
    finally:
        network.disconnect()


def test_its_own_classes_walk_move_home_and_follow(folder: Path, mock: RemoteMock) -> None:
    done = subprocess.run(
        [sys.executable, "-c", SESSION, mock.address],
        env=os.environ | {"PYTHONPATH": str(folder)}, capture_output=True, text=True, timeout=110, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout.splitlines()[-1])
    assert result["nodes"] == [1]
    assert result["states"] == ["OPERATION_ENABLED", "READY_TO_SWITCH_ON"]
    assert result["profile"] == pytest.approx(4000, abs=20)
    assert result["modes"] == [3, 6, 8, 9, 10]
    assert result["inputs"] == [255] * 8
    assert result["firmware"] == 0x0170
    assert result["homing"] == "HOMED"
    assert result["position"] == pytest.approx(4.0, abs=0.01)
    assert result["errors"] == []
