"""The drive mock by its bytes: the adapter's answers, the object dictionary, NMT, PDOs and failures."""

import struct

import pytest

from drivers.can.slcan import decode_line
from mock_devices.can.slcan_adapter import SlcanAdapter
from mock_devices.testing.epos4 import MS, DriveBench
from mock_devices.testing.wire import MemoryWire
from tests.mock_devices.epos4.wire import download, enabled, exchange, follow, sdo, status, upload

PDO_MAPPING = [
    (0x1800, 1, 4, 0xC0000181),
    (0x1800, 2, 1, 1),
    (0x1A00, 0, 1, 0),
    (0x1A00, 1, 4, 0x60410010),
    (0x1A00, 2, 4, 0x60640020),
    (0x1A00, 0, 1, 2),
    (0x1800, 1, 4, 0x40000181),
]


@pytest.fixture
def bench() -> DriveBench:
    return DriveBench()


# The adapter


def test_the_adapter_answers_as_the_lawicel_manual_says() -> None:
    bench = DriveBench()
    assert exchange(bench, b"C\r") == b"\r"
    assert exchange(bench, b"C\r") == b"\a"
    assert exchange(bench, b"\r") == b"\r"
    assert exchange(bench, b"V\rN\r") == b"V1013\rNA123\r"
    assert exchange(bench, b"F\r") == b"\a"
    assert exchange(bench, b"S9\rS8\r") == b"\a\r"
    assert exchange(bench, b"t0800\r") == b"\a"
    assert exchange(bench, b"O\r") == b"\r"
    assert exchange(bench, b"O\rS6\rF\r") == b"\a\aF00\r"
    assert exchange(bench, b"t0800\rT000000010\rr0800\rR000000010\r") == b"z\rZ\rz\rZ\r"
    assert exchange(bench, b"t08\rhello\r") == b"\a\a"


def test_a_line_feed_behind_a_command_is_no_command_of_its_own(bench: DriveBench) -> None:
    assert exchange(bench, b"C\r\nS8\r\nO\r\nV\r\n") == b"\r\r\rV1013\r"
    bench.mock.receive(bench.now())
    assert exchange(bench, b"\n") == b""


def test_time_stamps_are_sent_once_they_are_asked_for_and_our_decoder_passes_over_them(bench: DriveBench) -> None:
    assert exchange(bench, b"Z1\rC\rZ2\rZ1\rO\r") == b"\a\r\a\r\r"
    ask = b"t60184000100000000000\r"
    now_ms = bench.now() // MS % 60_000
    acknowledged, answer = exchange(bench, ask).split(b"\r")[:2]
    assert (acknowledged, len(answer), int(answer[-4:], 16)) == (b"z", 5 + 16 + 4, now_ms)
    assert decode_line(answer) == decode_line(answer[:-4])
    assert exchange(bench, b"C\rZ0\rO\r") == b"\r\r\r"
    assert len(exchange(bench, ask).split(b"\r")[1]) == 5 + 16


def test_an_adapter_without_a_bit_rate_does_not_open() -> None:
    wire = MemoryWire()
    adapter = SlcanAdapter(wire)
    wire.said = b"O\rS8\rO\r"
    assert adapter.receive() == []
    adapter.flush()
    assert wire.sent == [b"\a\r\r"]


def test_a_channel_at_another_bit_rate_reaches_no_node(bench: DriveBench) -> None:
    assert exchange(bench, b"C\rS6\rO\r") == b"\r\r\r"
    assert exchange(bench, b"t60184041600000000000\r") == b"z\r"


def test_a_listener_cannot_send(bench: DriveBench) -> None:
    assert exchange(bench, b"C\rL\rt0800\r") == b"\r\r\a"


def test_lines_come_in_pieces_and_overlong_ones_are_refused(bench: DriveBench) -> None:
    assert exchange(bench, b"t6018404160000") == b""
    assert exchange(bench, b"0000000\r").startswith(b"z\rt58184B416000")
    assert exchange(bench, b"t" * 500 + b"\r") == b"\a"


# Objects


def test_identity_and_status_are_read_expedited(bench: DriveBench) -> None:
    assert sdo(bench, "40 18 10 01 00 00 00 00") == "43181001FB000000"
    assert sdo(bench, "40 18 10 02 00 00 00 00") == "4318100200005061"
    assert sdo(bench, "40 41 60 00 00 00 00 00") == "4B41600050000000"
    assert sdo(bench, "40 61 60 00 00 00 00 00") == "4F61600001000000"


def test_a_text_is_read_in_segments(bench: DriveBench) -> None:
    assert sdo(bench, "40 08 10 00 00 00 00 00") == "4108100005000000"
    assert sdo(bench, "60 00 00 00 00 00 00 00") == "05" + b"EPOS4".hex().upper() + "0000"


def test_a_value_is_written_in_segments_as_well(bench: DriveBench) -> None:
    assert sdo(bench, "21 7A 60 00 04 00 00 00") == "607A600000000000"
    assert sdo(bench, "07 39 30 00 00 00 00 00") == "2000000000000000"
    assert upload(bench, 0x607A) == 12345


def test_the_makers_defaults(bench: DriveBench) -> None:
    defaults = {
        (0x6065, 0): 2000,
        (0x6081, 0): 1000,
        (0x6085, 0): 10_000,
        (0x607F, 0): 50_000,
        (0x6099, 1): 100,
        (0x60A9, 0): 0x00B44700,
        (0x6502, 0): 0x3A5,
        (0x1800, 1): 0x40000181,
        (0x1801, 1): 0xC0000281 - (1 << 32),
        (0x1A01, 1): 0x60410010,
        (0x607D, 2): (1 << 31) - 1,
    }
    assert {key: upload(bench, *key) for key in defaults} == defaults
    assert upload(bench, 0x6007, kind="h") == 3
    assert upload(bench, 0x605A, kind="h") == 6
    assert upload(bench, 0x60C2, 2, kind="b") == -3


@pytest.mark.parametrize(
    ("request_hex", "abort"),
    [
        ("40 34 12 00 00 00 00 00", 0x06020000),
        ("40 99 60 03 00 00 00 00", 0x06090011),
        ("40 00 18 05 00 00 00 00", 0x06090011),
        ("2B 41 60 00 00 00 00 00", 0x06010002),
        ("23 18 10 01 00 00 00 00", 0x06010002),
        ("23 40 60 00 06 00 00 00", 0x06070010),
        ("2F 98 60 00 23 00 00 00", 0x06090030),
        ("2F 60 60 00 07 00 00 00", 0x06090030),
        ("2F 60 60 00 04 00 00 00", 0x06090030),
        ("2B 5A 60 00 02 00 00 00", 0x06090030),
        ("2B 07 60 00 01 00 00 00", 0x06090030),
        ("23 10 10 01 00 00 00 00", 0x08000020),
        ("2B 00 18 05 64 00 00 00", 0x06090011),
        ("A0 08 10 00 00 00 00 00", 0x05040001),
        ("60 00 00 00 00 00 00 00", 0x05040001),
    ],
)
def test_what_is_not_allowed_is_aborted_with_the_right_code(bench: DriveBench, request_hex: str, abort: int) -> None:
    answer = bytes.fromhex(sdo(bench, request_hex))
    assert answer[0] == 0x80
    assert struct.unpack_from("<I", answer, 4)[0] == abort


def test_a_toggle_bit_that_stands_still_is_aborted(bench: DriveBench) -> None:
    sdo(bench, "40 08 10 00 00 00 00 00")
    assert sdo(bench, "70 00 00 00 00 00 00 00") == "8008100000000305"


def test_the_current_limit_reaches_the_motor(bench: DriveBench) -> None:
    assert download(bench, 0x3001, 2, 4, 2500) == 0
    assert bench.plant.current_limit_A == 2.5


# Network management and heartbeats


def test_a_node_says_that_it_booted_and_waits_in_pre_operational() -> None:
    bench = DriveBench()
    assert exchange(bench, b"t00028101\r") == b"z\r"
    assert exchange(bench, b"t60184041600000000000\r") == b"z\r"
    bench.run(0.06)
    assert bench.heard() == b"t701100\r"
    assert status(bench) & 0x200 == 0


def test_a_reset_brings_back_defaults_of_communication_or_of_everything(bench: DriveBench) -> None:
    download(bench, 0x1017, 0, 2, 100)
    download(bench, 0x6065, 0, 4, 5000)
    exchange(bench, b"t00028201\r")
    bench.run(0.06)
    assert (upload(bench, 0x1017, kind="H"), upload(bench, 0x6065)) == (0, 5000)
    exchange(bench, b"t00028100\r")
    bench.run(0.06)
    assert upload(bench, 0x6065) == 2000


def test_orders_to_another_node_are_not_obeyed(bench: DriveBench) -> None:
    exchange(bench, b"t00020102\r")
    assert status(bench) & 0x200 == 0
    exchange(bench, b"t00020101\r")
    assert status(bench) & 0x200


def test_a_stopped_node_answers_no_sdo(bench: DriveBench) -> None:
    exchange(bench, b"t00020201\r")
    assert exchange(bench, b"t60184041600000000000\r") == b"z\r"


def test_heartbeats_come_in_their_period_and_say_the_state(bench: DriveBench) -> None:
    download(bench, 0x1017, 0, 2, 20)
    bench.heard()
    bench.run(0.1)
    assert bench.heard() == b"t70117F\r" * 5
    exchange(bench, b"t00020101\r")
    bench.run(0.04)
    assert bench.heard() == b"t701105\r" * 2
    download(bench, 0x1017, 0, 2, 0)
    bench.heard()
    bench.run(0.1)
    assert bench.heard() == b""


def test_a_missing_host_is_an_error_that_leaves_operational(bench: DriveBench) -> None:
    exchange(bench, b"t00020101\r")
    download(bench, 0x1016, 1, 4, 127 << 16 | 40)
    bench.run(1.0)
    exchange(bench, b"t77F105\r")
    bench.run(0.039)
    assert bench.heard() == b""
    bench.run(0.002)
    assert bench.heard() == b"t08183081100000000000\r"
    assert status(bench) & 0x24F == 0x08
    assert upload(bench, 0x603F, kind="H") == 0x8130
    assert upload(bench, 0x1001, kind="B") == 0x10
    assert upload(bench, 0x1003, 1) == 0x8130


def test_heartbeats_of_strangers_keep_nobody_alive(bench: DriveBench) -> None:
    download(bench, 0x1016, 1, 4, 127 << 16 | 40)
    exchange(bench, b"t77F105\r")
    for _ in range(5):
        bench.run(0.01)
        exchange(bench, b"t77E105\r")
    assert upload(bench, 0x603F, kind="H") == 0x8130


@pytest.mark.parametrize(("behaviour", "state"), [(0, "7F"), (1, "05"), (2, "04")])
def test_object_1029_says_where_a_communication_error_leads(bench: DriveBench, behaviour: int, state: str) -> None:
    download(bench, 0x1029, 1, 1, behaviour)
    download(bench, 0x1017, 0, 2, 10)
    download(bench, 0x1016, 1, 4, 127 << 16 | 40)
    exchange(bench, b"t00020101\r")
    exchange(bench, b"t77F105\r")
    bench.run(0.06)
    assert bench.heard().endswith(f"t7011{state}\r".encode())


def test_an_unguarded_node_misses_no_host(bench: DriveBench) -> None:
    bench.mock.unguarded = True
    download(bench, 0x1016, 1, 4, 127 << 16 | 40)
    exchange(bench, b"t77F105\r")
    bench.run(0.1)
    assert upload(bench, 0x603F, kind="H") == 0


# Process data


def test_a_pdo_is_mapped_while_it_is_off_and_comes_with_each_sync(bench: DriveBench) -> None:
    for index, sub, size, value in PDO_MAPPING:
        assert download(bench, index, sub, size, value) == 0
    assert exchange(bench, b"t0800\r") == b"z\r"
    exchange(bench, b"t00020101\r")
    assert exchange(bench, b"t0800\r") == b"z\rt1816500200000000\r"
    assert exchange(bench, b"t0800\rt0800\r") == b"z\rz\r" + b"t1816500200000000\r" * 2


def test_the_time_of_every_sync_that_is_obeyed_is_kept(bench: DriveBench) -> None:
    exchange(bench, b"t0800\r")
    assert list(bench.mock.synced_ns) == []
    exchange(bench, b"t00020101\r")
    exchange(bench, b"t0800\rt0800\r")
    assert list(bench.mock.synced_ns) == [bench.now(), bench.now()]


def test_a_pdo_of_type_3_comes_with_every_third_sync(bench: DriveBench) -> None:
    for index, sub, size, value in PDO_MAPPING[:-1]:
        download(bench, index, sub, size, value)
    download(bench, 0x1800, 2, 1, 3)
    download(bench, 0x1800, 1, 4, 0x40000181)
    exchange(bench, b"t00020101\r")
    assert exchange(bench, b"t0800\r" * 6).count(b"t1816") == 2


@pytest.mark.parametrize(
    ("index", "sub", "size", "value", "abort"),
    [
        (0x1A00, 0, 1, 0, 0x08000022),
        (0x1800, 1, 4, 0x40000182, 0x06090030),
        (0x1800, 2, 1, 250, 0x06090030),
        (0x1800, 3, 2, 100, 0x08000022),
        (0x1A01, 1, 4, 0x60410010, 0x08000022),
        (0x1800, 5, 2, 100, 0x06090011),
    ],
)
def test_pdo_parameters_are_protected(
    bench: DriveBench, index: int, sub: int, size: int, value: int, abort: int
) -> None:
    assert download(bench, index, sub, size, value) == abort


@pytest.mark.parametrize(
    ("value", "abort"),
    [
        (0x60400010, 0x06040041),
        (0x60980008, 0x06040041),
        (0x60410020, 0x06040041),
        (0x12340010, 0x06040041),
        (0x60640020, 0),
    ],
)
def test_only_what_may_be_sent_is_mapped_into_a_sent_pdo(bench: DriveBench, value: int, abort: int) -> None:
    assert download(bench, 0x1A01, 0, 1, 0) == 0
    assert download(bench, 0x1A01, 1, 4, value) == abort


def test_a_pdo_holds_eight_bytes_and_no_gaps(bench: DriveBench) -> None:
    download(bench, 0x1A01, 0, 1, 0)
    for sub, value in enumerate((0x60640020, 0x606C0020, 0x60410010), start=1):
        assert download(bench, 0x1A01, sub, 4, value) == 0
    assert download(bench, 0x1A01, 0, 1, 3) == 0x06040042
    assert download(bench, 0x1A01, 0, 1, 2) == 0
    download(bench, 0x1A02, 0, 1, 0)
    assert download(bench, 0x1A02, 0, 1, 3) == 0x06040041


def test_by_default_the_statusword_is_sent_on_change_at_most_each_millisecond(bench: DriveBench) -> None:
    assert b"t1812" in exchange(bench, b"t00020101\r")
    assert exchange(bench, b"t60182B40600006000000\r").count(b"t1812") == 0
    bench.run(0.002)
    bench.say(b"\r")
    assert b"t18123102" in bench.heard()


def test_a_controlword_by_pdo_is_obeyed_when_operational(bench: DriveBench) -> None:
    exchange(bench, b"t20120600\r")
    assert status(bench) & 0x6F == 0x40
    exchange(bench, b"t00020101\rt20120600\rt20120700\r")
    assert status(bench) & 0x6F == 0x23


def test_a_synchronous_set_point_waits_for_the_sync(bench: DriveBench) -> None:
    download(bench, 0x1400, 1, 4, 0x80000201)
    download(bench, 0x1400, 2, 1, 1)
    download(bench, 0x1400, 1, 4, 0x201)
    exchange(bench, b"t00020101\rt20120600\r")
    assert status(bench) & 0x6F == 0x40
    exchange(bench, b"t0800\r")
    assert status(bench) & 0x6F == 0x21


def test_a_pdo_too_short_is_an_error(bench: DriveBench) -> None:
    exchange(bench, b"t00020101\r")
    assert b"t08181082100000000000\r" in exchange(bench, b"t201106\r")


# Knobs


def test_a_silent_drive_neither_hears_nor_speaks(bench: DriveBench) -> None:
    download(bench, 0x1017, 0, 2, 10)
    bench.mock.silent = True
    assert exchange(bench, b"t60184041600000000000\r") == b"z\r"
    bench.run(0.05)
    assert bench.heard() == b""
    bench.mock.silent = False
    assert status(bench)


def test_a_frozen_drive_repeats_its_position_while_it_moves(bench: DriveBench) -> None:
    download(bench, 0x60FF, 0, 4, 120)
    enabled(bench, 3)
    bench.mock.frozen = True
    before = upload(bench, 0x6064)
    follow(bench, 0.3)
    assert upload(bench, 0x6064) == before
    assert bench.mock.frozen
    bench.mock.frozen = False
    assert upload(bench, 0x6064) > before + 1000


def test_another_device_has_another_identity(bench: DriveBench) -> None:
    bench.mock.wrong_identity = True
    assert upload(bench, 0x1018, 1) == 0x24A
    assert upload(bench, 0x1018, 2) == 0x10002


def test_nothing_is_due_while_nothing_can_happen(bench: DriveBench) -> None:
    assert bench.mock.due_ns - bench.now() > 1_000_000_000_000
    assert bench.mock.endpoints() == {"slcan": "memory"}
    enabled(bench, 1)
    assert bench.mock.due_ns - bench.now() <= 1_000_000


def test_it_holds_the_increments_of_a_turn_and_takes_no_others() -> None:
    bench = DriveBench(increments_per_rev=4096.0)
    assert upload(bench, 0x3000, 5, "I") == 4096
    assert download(bench, 0x3000, 5, 4, 1) == 0x06010002
