"""python-can and canopen, unchanged, against the drive mock in another process over a pseudo-terminal."""

import struct
import threading
import time
from collections.abc import Callable, Iterator

import can
import canopen
import pytest
from can.interfaces.slcan import slcanBus
from canopen.objectdictionary import ODRecord, ODVariable, datatypes

from drivers.epos4.objects import TEXT, Entry
from mock_devices.epos4.table import EPOS4
from mock_devices.testing.commands import until
from mock_devices.testing.epos4 import remote_drive
from mock_devices.testing.remote import RemoteMock

OBJECTS = EPOS4.objects
pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("clients")]
TYPES = {
    "B": datatypes.UNSIGNED8,
    "H": datatypes.UNSIGNED16,
    "I": datatypes.UNSIGNED32,
    "b": datatypes.INTEGER8,
    "h": datatypes.INTEGER16,
    "i": datatypes.INTEGER32,
    "?": datatypes.BOOLEAN,
    "Q": datatypes.UNSIGNED64,
    TEXT: datatypes.VISIBLE_STRING,
}
PATIENCE_S = 10.0


def variable(entry: Entry) -> ODVariable:
    item = ODVariable(entry.name, entry.index, entry.sub)
    item.data_type = TYPES[entry.kind]
    item.access_type = "ro" if entry.access in ("ro", "ro+", "const") else "rw"
    return item


def dictionary() -> canopen.ObjectDictionary:
    """What an electronic data sheet would give canopen, from our own table."""
    table = canopen.ObjectDictionary()  # type: ignore[no-untyped-call]
    for index in sorted({index for index, _ in OBJECTS}):
        entries = [entry for entry in OBJECTS.values() if entry.index == index]
        if len(entries) == 1 and entries[0].sub == 0:
            table.add_object(variable(entries[0]))
            continue
        record = ODRecord(f"{index:04X}", index)
        for entry in sorted(entries, key=lambda entry: entry.sub):
            record.add_member(variable(entry))
        table.add_object(record)
    return table


def eventually(condition: Callable[[], bool]) -> None:
    until(condition, PATIENCE_S, "what this session waits for")


@pytest.fixture
def mock() -> Iterator[RemoteMock]:
    with remote_drive() as mock:
        yield mock


@pytest.fixture
def network(mock: RemoteMock) -> Iterator[canopen.Network]:
    network = canopen.Network()
    network.connect(interface="slcan", channel=mock.address, bitrate=1_000_000, sleep_after_open=0, timeout=0.01)
    network.check()
    yield network
    network.sync.stop()  # type: ignore[no-untyped-call]
    network.disconnect()


@pytest.fixture
def node(network: canopen.Network) -> canopen.RemoteNode:
    """Answering: what a drive says before its adapter's channel is open, nobody hears."""
    node = network.add_node(1, dictionary())
    node.sdo.RESPONSE_TIMEOUT = PATIENCE_S
    assert node.sdo[0x6041].raw
    return node


def test_python_can_finds_an_adapter_and_a_node_behind_it(mock: RemoteMock) -> None:
    with can.Bus(interface="slcan", channel=mock.address, bitrate=1_000_000, sleep_after_open=0, timeout=0.01) as bus:
        assert isinstance(bus, slcanBus)
        bus.flush()
        assert bus.get_version(PATIENCE_S) == (10, 13)
        assert bus.get_serial_number(PATIENCE_S) == "A123"
        request = can.Message(arbitration_id=0x601, is_extended_id=False, data=bytes.fromhex("4018100100000000"))
        bus.send(request)
        answers: list[can.Message] = []
        deadline = time.monotonic() + PATIENCE_S
        while not answers and time.monotonic() < deadline:
            answer = bus.recv(0.1)
            answers += [answer] if answer else []
        assert answers[0].arbitration_id == 0x581
        assert bytes(answers[0].data) == bytes.fromhex("43181001FB000000")
        assert not answers[0].is_extended_id


def test_canopen_reads_and_writes_objects(node: canopen.RemoteNode) -> None:
    assert node.sdo[0x1018][1].raw == 0xFB
    assert node.sdo[0x1018][2].raw >> 16 == 0x6150
    assert node.sdo[0x1008].raw == "EPOS4"
    node.sdo[0x6065].raw = 4000
    assert node.sdo[0x6065].raw == 4000
    node.sdo.download(0x607A, 0, struct.pack("<i", -12345), force_segment=True)
    assert node.sdo[0x607A].raw == -12345


@pytest.mark.parametrize(
    ("index", "sub", "data", "code"),
    [(0x6041, 0, bytes(2), 0x06010002), (0x1234, 0, bytes(1), 0x06020000), (0x6098, 0, b"\x23", 0x06090030)],
)
def test_canopen_sees_the_aborts(node: canopen.RemoteNode, index: int, sub: int, data: bytes, code: int) -> None:
    with pytest.raises(canopen.SdoAbortedError) as refused:
        node.sdo.download(index, sub, data)
    assert refused.value.code == code


def test_canopen_orders_states_and_hears_heartbeats_and_the_boot_up(node: canopen.RemoteNode) -> None:
    node.sdo[0x1017].raw = 20
    assert node.nmt.wait_for_heartbeat(PATIENCE_S) == "PRE-OPERATIONAL"
    node.nmt.state = "OPERATIONAL"
    eventually(lambda: bool(node.nmt.wait_for_heartbeat(PATIENCE_S) == "OPERATIONAL"))
    node.nmt.state = "STOPPED"
    eventually(lambda: bool(node.nmt.wait_for_heartbeat(PATIENCE_S) == "STOPPED"))
    booted = threading.Event()
    node.nmt.add_heartbeat_callback(lambda state: booted.set() if state == 0 else None)
    node.nmt.state = "RESET"
    assert booted.wait(PATIENCE_S)
    assert node.sdo[0x1017].raw == 0


def test_canopen_maps_pdos_and_gets_them_with_its_sync(network: canopen.Network, node: canopen.RemoteNode) -> None:
    node.tpdo.read()  # type: ignore[no-untyped-call]
    assert node.tpdo[1].enabled
    assert [variable.index for variable in node.tpdo[1].map] == [0x6041]
    assert not node.tpdo[2].enabled
    pdo = node.tpdo[2]
    pdo.clear()
    pdo.add_variable(0x6041)
    pdo.add_variable(0x6064)
    pdo.trans_type = 1
    pdo.enabled = True
    pdo.save()
    node.nmt.state = "OPERATIONAL"
    network.sync.start(0.01)
    received = [pdo.wait_for_reception(PATIENCE_S) for _ in range(5)]
    assert all(received)
    assert pdo[0x6041].raw & 0x6F == 0x40
    assert pdo[0x6064].raw == 0


def test_canopen_sends_a_controlword_by_pdo(node: canopen.RemoteNode) -> None:
    node.rpdo.read()  # type: ignore[no-untyped-call]
    node.nmt.state = "OPERATIONAL"
    pdo = node.rpdo[1]
    assert [variable.index for variable in pdo.map] == [0x6040]
    pdo[0x6040].raw = 0x06
    pdo.transmit()
    eventually(lambda: bool(node.sdo[0x6041].raw & 0x6F == 0x21))


def test_canopen_walks_the_drive_up_and_moves_it_by_plain_objects(mock: RemoteMock, node: canopen.RemoteNode) -> None:
    node.sdo[0x6060].raw = 1
    node.sdo[0x6081].raw = 360
    states = []
    for word in (0x06, 0x07, 0x0F):
        node.sdo[0x6040].raw = word
        states.append(node.sdo[0x6041].raw & 0x6F)
    assert states == [0x21, 0x23, 0x27]
    node.sdo[0x607A].raw = 10_000
    node.sdo[0x6040].raw = 0x1F
    assert node.sdo[0x6041].bits[12]
    node.sdo[0x6040].raw = 0x0F
    assert not node.sdo[0x6041].bits[12]
    eventually(lambda: bool(node.sdo[0x6041].bits[10]))
    eventually(lambda: abs(node.sdo[0x6064].raw - 10_000) < 10)
    assert mock.order(ask=True)["position_mm"] == pytest.approx(8 + 5, abs=0.01)


def test_canopen_hears_emergencies_and_their_end(mock: RemoteMock, node: canopen.RemoteNode) -> None:
    mock.order(fault=0x8611)
    eventually(lambda: bool(node.emcy.active))
    assert [(error.code, error.register) for error in node.emcy.active] == [(0x8611, 0x80)]
    node.sdo[0x6040].raw = 0x80
    eventually(lambda: not node.emcy.active)
    assert node.sdo[0x6041].raw & 0x4F == 0x40
