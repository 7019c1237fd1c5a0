"""python canopen with its own CiA 402 profile, unchanged, on the drive of no maker, by its data sheet alone.

Each session is run once more for each mistake that a drive could have in it, and must notice that.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import canopen
import pytest
from canopen.objectdictionary import ODVariable
from canopen.profiles.p402 import BaseNode402, OperationMode

from drivers.canopen.nmt import NmtState
from drivers.cia402.device import NEUTRAL
from drivers.epos4.cia402 import PdsState, Statusword
from mock_devices.bench import Bench
from mock_devices.cia402 import mock as neutral_drive
from mock_devices.cia402.states import SWITCH_ON, TRANSITIONS
from mock_devices.devices import DeviceFactory
from mock_devices.epos4 import drive as inside
from mock_devices.epos4.dictionary import Dictionary
from mock_devices.epos4.mock import Epos4Mock
from mock_devices.parameters import Parameters
from mock_devices.testing.commands import until
from mock_devices.testing.played import played

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("clients")]
PATIENCE_S = 10.0
SYNC_S = 0.01
TARGET_REACHED, ACKNOWLEDGE = 1 << 10, 1 << 12


class Patient(BaseNode402):
    """The client as it is; its own tenths of a second are too few on a computer that others use too."""

    TIMEOUT_SWITCH_OP_MODE = PATIENCE_S
    TIMEOUT_SWITCH_STATE_FINAL = PATIENCE_S
    TIMEOUT_SWITCH_STATE_SINGLE = PATIENCE_S
    TIMEOUT_CHECK_TPDO = PATIENCE_S


class Session(NamedTuple):
    """A client's node, and the physics behind the drive."""

    node: Any
    bench: Bench


def eventually(condition: Callable[[], object]) -> None:
    until(condition, PATIENCE_S, "what this session waits for")


@contextmanager
def opened() -> Iterator[Session]:
    bench = Bench(Parameters(), start_ns=time.monotonic_ns())
    (device,) = neutral_drive.neutral(DeviceFactory(bench, bench.now_ns, time.monotonic_ns, seed=0))
    mock = device.mock
    assert isinstance(mock, Epos4Mock)
    network = canopen.Network()
    with played(mock, bench.advance):
        eventually(lambda: mock.nmt is NmtState.PRE_OPERATIONAL)
        line = mock.endpoints()["slcan"]
        network.connect(interface="slcan", channel=line, bitrate=1_000_000, sleep_after_open=0, timeout=0.01)
        try:
            node = network.add_node(Patient(1, str(NEUTRAL)))  # type: ignore[no-untyped-call]
            node.sdo.RESPONSE_TIMEOUT = PATIENCE_S
            node.nmt.state = "PRE-OPERATIONAL"
            yield Session(node, bench)
        finally:
            network.sync.stop()  # type: ignore[no-untyped-call]
            network.disconnect()


def operational(session: Session) -> Any:
    """Statusword and mode come with each SYNC, as the profile's own waiting wants it."""
    node = session.node
    node.tpdo.read()
    shown = node.tpdo[1]
    shown.add_variable(0x6061)
    shown.trans_type = 1
    shown.save()
    node.setup_402_state_machine()
    node.nmt.state = "OPERATIONAL"
    node.network.sync.start(SYNC_S)
    return node


def variables(node: Any) -> dict[tuple[int, int], ODVariable]:
    """Every entry of the data sheet as the client reads it."""
    found: dict[tuple[int, int], ODVariable] = {}
    for index in node.object_dictionary:
        item = node.object_dictionary[index]
        members = {0: item} if isinstance(item, ODVariable) else item
        found |= {(index, sub): members[sub] for sub in members}
    return found


def has_what_its_sheet_says(session: Session) -> None:
    listed = variables(session.node)
    assert len(listed) > 100
    for (index, sub), variable in listed.items():
        name = f"{index:04X}:{sub:02X}"
        data = session.node.sdo.upload(index, sub)
        if variable.data_type in canopen.objectdictionary.datatypes.NUMBER_TYPES:
            assert len(data) * 8 == len(variable), name
            assert variable.access_type == "ro" or variable.decode_raw(data) == variable.default, name
        if variable.access_type in ("ro", "const"):
            with pytest.raises(canopen.SdoAbortedError) as refused:
                session.node.sdo.download(index, sub, data)
            assert refused.value.code == 0x06010002, name


def takes_back_the_pdos_it_gave(session: Session) -> None:
    """Its transmission type is the maker's own, 254."""
    node = session.node
    node.pdo.read()
    before = [(pdo.cob_id, pdo.enabled, pdo.trans_type, len(pdo.map)) for pdo in node.pdo.values()]
    node.pdo.save()
    node.pdo.read()
    assert [(pdo.cob_id, pdo.enabled, pdo.trans_type, len(pdo.map)) for pdo in node.pdo.values()] == before
    assert {trans_type for _, _, trans_type, _ in before} == {254}


def walks_through_its_states(session: Session) -> None:
    node = operational(session)
    for target in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED", "SWITCHED ON", "READY TO SWITCH ON",
                   "OPERATION ENABLED", "SWITCH ON DISABLED"):  # fmt: skip
        node.state = target
        assert node.state == target
        assert session.bench.axis.powered is (target == "OPERATION ENABLED")


def ends_a_quick_stop_as_it_was_told(session: Session) -> None:
    """Option 6 holds the axis where it stopped, 2, as delivered, lets it go (CiA 402, object 605A)."""
    node = operational(session)
    assert node.sdo[0x605A].raw == 2
    node.state = "OPERATION ENABLED"
    node.controlword = 0x02
    eventually(lambda: node.state == "SWITCH ON DISABLED")
    node.sdo[0x605A].raw = 6
    node.state = "OPERATION ENABLED"
    node.state = "QUICK STOP ACTIVE"
    time.sleep(10 * SYNC_S)
    assert node.state == "QUICK STOP ACTIVE" and session.bench.axis.powered
    node.state = "OPERATION ENABLED"


def in_mode(node: Any, mode: str) -> bool:
    return bool(node.op_mode == mode)


def has_the_modes_that_it_advertises(session: Session) -> None:
    node = operational(session)
    taken = set()
    for mode in OperationMode.SUPPORTED.keys() - {"NO MODE"}:
        try:
            node.sdo[0x6060].raw = OperationMode.NAME2CODE[mode]
        except canopen.SdoAbortedError as refused:
            assert refused.code == 0x06090030, mode
            continue
        eventually(partial(in_mode, node, mode))
        taken.add(mode)
    assert taken == {mode for mode in OperationMode.SUPPORTED if mode != "NO MODE" and node.is_op_mode_supported(mode)}
    assert taken == {"PROFILED POSITION", "PROFILED VELOCITY", "HOMING", "CYCLIC SYNCHRONOUS POSITION"}


def goes_to(session: Session, target_um: int) -> None:
    node = session.node
    node.op_mode = "PROFILED POSITION"
    node.sdo[0x6081].raw = 30_000
    node.sdo[0x607A].raw = target_um
    node.controlword = 0x0F  # a start of homing left the bit set that now has to rise
    node.controlword = 0x1F


def homes_and_counts_in_micrometres(session: Session) -> None:
    node = operational(session)
    node.sdo[0x6098].raw = 17
    assert not node.is_homed()
    assert node.homing(timeout=PATIENCE_S)
    assert node.is_homed()
    assert session.bench.axis.position_mm == pytest.approx(0.0, abs=0.1)
    goes_to(session, 12_000)
    eventually(lambda: node.statusword & ACKNOWLEDGE)
    node.controlword = 0x0F
    eventually(lambda: node.statusword & TARGET_REACHED)
    assert node.sdo[0x6064].raw == pytest.approx(12_000, abs=50)
    assert session.bench.axis.position_mm == pytest.approx(12.0, abs=0.15)


def fails_and_is_reset(session: Session) -> None:
    """A following error that happens: the window is narrower than any axis can follow."""
    node = operational(session)
    node.state = "OPERATION ENABLED"
    node.sdo[0x6065].raw = 1
    goes_to(session, 20_000)
    eventually(lambda: node.state == "FAULT")
    eventually(lambda: node.emcy.active)
    assert [error.code for error in node.emcy.active] == [0x8611] == [node.sdo[0x603F].raw]
    assert not session.bench.axis.powered
    node.sdo[0x6065].raw = 5000
    node.reset_from_fault()
    assert node.state == "OPERATION ENABLED"
    eventually(lambda: not node.emcy.active)


SESSIONS = (
    has_what_its_sheet_says, takes_back_the_pdos_it_gave, walks_through_its_states, ends_a_quick_stop_as_it_was_told,
    has_the_modes_that_it_advertises, homes_and_counts_in_micrometres, fails_and_is_reset,
)  # fmt: skip


@pytest.mark.parametrize("session", SESSIONS, ids=lambda session: session.__name__)
def test_canopen_and_the_drive(session: Callable[[Session], None]) -> None:
    with opened() as there:
        session(there)


def counts_as_the_epos4(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(neutral_drive, "UNITS_PER_MM", 2000.0)


def refuses_a_mode_that_it_advertises(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(inside, "MODES", (inside.PROFILE_POSITION, inside.CYCLIC_POSITION))


def misses_a_transition(patch: pytest.MonkeyPatch) -> None:
    patch.delitem(TRANSITIONS, (PdsState.READY, SWITCH_ON))


def never_says_that_it_arrived(patch: pytest.MonkeyPatch) -> None:
    made = neutral_drive.table
    mask = 0xFFFF & ~Statusword.TARGET_REACHED
    patch.setattr(neutral_drive, "table", lambda lead_mm: replace(made(lead_mm), status_mask=mask))


def lets_itself_be_written(patch: pytest.MonkeyPatch) -> None:
    def write(self: Dictionary, index: int, sub: int, data: bytes) -> None:
        entry = self.objects[index, sub]
        self.put(entry, entry.unpack(data) or 0)

    patch.setattr(Dictionary, "write", write)


def keeps_its_power_in_a_fault(patch: pytest.MonkeyPatch) -> None:
    def cut(self: inside.Drive, state: PdsState) -> None:
        self.state = state

    patch.setattr(inside.Drive, "_cut", cut)


PLANTED = (
    (counts_as_the_epos4, homes_and_counts_in_micrometres),
    (counts_as_the_epos4, has_what_its_sheet_says),
    (refuses_a_mode_that_it_advertises, has_the_modes_that_it_advertises),
    (misses_a_transition, walks_through_its_states),
    (never_says_that_it_arrived, homes_and_counts_in_micrometres),
    (lets_itself_be_written, has_what_its_sheet_says),
    (keeps_its_power_in_a_fault, fails_and_is_reset),
)


@pytest.mark.parametrize(("plant", "session"), PLANTED, ids=lambda either: either.__name__)
def test_a_mistake_of_the_drive_is_noticed(
    plant: Callable[[pytest.MonkeyPatch], None], session: Callable[[Session], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    plant(monkeypatch)
    monkeypatch.setitem(globals(), "PATIENCE_S", 1.0)
    for name in ("FINAL", "SINGLE"):
        monkeypatch.setattr(Patient, f"TIMEOUT_SWITCH_STATE_{name}", 1.0)
    with pytest.raises((AssertionError, RuntimeError, pytest.fail.Exception)), opened() as there:
        session(there)
