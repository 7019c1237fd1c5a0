"""Starting and leaving the tracker: the manual's order, and one clear sentence for each way it can fail."""

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from drivers.ndi.device import NdiTracker
from mock_devices.testing.ndi import TrackerBench, run, started
from rig.config.products.ndi_polaris import PolarisWiring
from rig.errors import DeviceError, UsageError


@pytest.fixture
def bench() -> Iterator[TrackerBench]:
    bench = TrackerBench()
    yield bench
    bench.release()


def test_start_over_tcp_follows_the_manual(bench: TrackerBench) -> None:
    started(bench)
    assert bench.commands == [
        b"INIT:E3A5\r",
        b"VER:065EE\r",
        b"GETINFO:Features.Firmware.Version0492\r",
        b"PHSR:01E03E\r",
        b"PHSR:0020FF\r",
        b"PHSR:02E17E\r",
        b"PINIT:0131EA\r",
        b"PINIT:0230AA\r",
        b"PHSR:0321BF\r",
        b"PENA:01D6D3B\r",
        b"PENA:02D9D3B\r",
        b"PHSR:04E3FE\r",
        b"TSTART:5423\r",
    ]


def test_over_a_serial_line_the_speed_is_raised_and_given_back() -> None:
    bench = TrackerBench(address="/dev/memory")
    device = started(bench)
    assert bench.bauds == [9600, 115200]
    assert b"COMM:500000048\r" in bench.commands
    device.close()
    assert bench.commands[-2:] == [b"TSTOP:2C14\r", b"COMM:000000084\r"]
    bench.release()


def test_the_tracker_tells_who_it_is(bench: TrackerBench) -> None:
    identity = started(bench).identity
    assert identity.product == "Polaris Vega Control Firmware"
    assert identity.serial == "P9-00001"
    assert identity.firmware == "007.000.012"
    assert identity.settings["freeze_tag"] == "Polaris Vega 024"


def test_before_start_there_is_no_identity_and_no_port(bench: TrackerBench) -> None:
    device = NdiTracker(bench.open, PolarisWiring())
    for use in (lambda: device.identity, device.fileno, lambda: device.poll(0)):
        with pytest.raises(DeviceError, match="not started; call start first"):
            use()


def test_tool_definitions_are_loaded_in_the_order_of_the_tools(bench: TrackerBench, tmp_path: Path) -> None:
    roms = []
    for name in ("tip", "arm"):
        path = tmp_path / f"{name}.rom"
        path.write_bytes(b"NDI\0" + name.encode())
        roms.append(path)
    device = started(bench, roms=tuple(roms))
    writes = [command for command in bench.commands if command.startswith(b"PVWR:")]
    assert len(writes) == 2 * 16
    assert writes[0].startswith(b"PVWR:0300004E44490074697000")
    assert writes[16].startswith(b"PVWR:0400004E44490061726D00")
    assert [sample.tool for sample in run(bench, device, 100, 130)[:2]] == [0, 1]
    assert [sample.valid for sample in run(bench, device, 130, 160)[:2]] == [1, 1]


def test_definitions_of_an_earlier_session_are_freed_first(bench: TrackerBench, tmp_path: Path) -> None:
    path = tmp_path / "tip.rom"
    path.write_bytes(b"NDI\0")
    for _ in range(30):
        device = started(bench, tools=("tip",), roms=(path,))
        device.close()
    assert run(bench, started(bench, tools=("tip",), roms=(path,)), 100, 130)[0].valid == 1


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "cannot be read: No such file"), (b"a picture", "not a tool definition")],
)
def test_a_bad_tool_definition_is_refused_before_the_port_is_opened(
    bench: TrackerBench, tmp_path: Path, content: bytes | None, message: str
) -> None:
    path = tmp_path / "tip.rom"
    if content:
        path.write_bytes(content)
    with pytest.raises(UsageError, match=f"tip.rom: .*{message}"):
        started(bench, tools=("tip",), roms=(path,))
    assert bench.bauds == []


def test_each_tool_needs_its_definition(bench: TrackerBench, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"tracker.roms: 1 files for 2 tools \(tip, arm\)"):
        started(bench, roms=(tmp_path / "tip.rom",))


def test_more_tools_named_than_plugged_in_are_told(bench: TrackerBench) -> None:
    with pytest.raises(DeviceError, match=r"2 tools are .* names 3 .*; plug them in, or give tracker.roms"):
        started(bench, tools=("tip", "arm", "couch"))
    assert bench.closed


def test_more_tools_plugged_in_than_named_are_told_with_what_to_do(bench: TrackerBench) -> None:
    with pytest.raises(
        DeviceError, match=r"2 tools are .* names 1 \(tip\); unplug the others, or name them in tracker"
    ):
        started(bench, tools=("tip",))


def test_another_device_behind_the_port_is_told(bench: TrackerBench) -> None:
    bench.canned = {"VER": "V1013"}
    with pytest.raises(DeviceError, match="VER answered 'V1013', which is no NDI position sensor; check the port"):
        started(bench)
    assert bench.closed


@pytest.mark.parametrize(
    ("command", "answer", "message"),
    [
        ("INIT", "ERROR15", r"refused INIT \(ERROR15: the measurement system cannot be initialised\)"),
        ("PENA", "ERROR0E", r"refused PENA \(ERROR0E: port handle not initialised\)"),
        ("TSTART", "ERROR12", r"refused TSTART \(ERROR12: tracking cannot be started\)"),
        ("PHSR", "OKAY", "PHSR:01 answered 'OKAY', which is no list of handles"),
    ],
)
def test_a_refusal_during_start_is_told_and_closes_the_port(
    bench: TrackerBench, command: str, answer: str, message: str
) -> None:
    bench.canned = {command: answer}
    with pytest.raises(DeviceError, match=message):
        started(bench)
    assert bench.closed


def test_a_warning_during_start_is_kept(bench: TrackerBench) -> None:
    bench.canned = {"TSTART": "WARNING"}
    assert started(bench).identity.settings["warnings"] == "TSTART:"


def test_old_firmware_without_information_is_known_by_its_freeze_tag(bench: TrackerBench) -> None:
    bench.canned = {"GETINFO": "ERROR01"}
    assert started(bench).identity.firmware == "Polaris Vega 024"


def test_a_camera_that_names_no_freeze_tag_starts_and_its_firmware_is_unknown(bench: TrackerBench) -> None:
    bench.canned = {"GETINFO": "ERROR01", "VER": "Polaris Vega Control Firmware\nNDI S/N: P9-01234"}
    identity = started(bench).identity
    assert (identity.product, identity.serial, identity.firmware) == ("Polaris Vega Control Firmware", "P9-01234", "")


def leaping() -> Callable[[], int]:
    """A clock on which every deadline is over at once."""
    ticks = itertools.count(0, 10_000_000_000)
    return lambda: next(ticks)


@pytest.mark.parametrize("address", ["tcp://memory:1", "/dev/memory"])
def test_a_silent_port_is_told(address: str) -> None:
    bench = TrackerBench(address=address)
    bench.mock.silent = True
    bench.heeds_break = False
    device = NdiTracker(bench.open, PolarisWiring(), now=leaping())
    with pytest.raises(DeviceError, match=f"{address}: INIT brought no reply; check power, cable"):
        device.start()
    assert bench.closed
    bench.release()


def test_a_port_full_of_other_bytes_is_told(bench: TrackerBench) -> None:
    bench.canned = {"INIT": "z\r" * 300}
    with pytest.raises(DeviceError, match="INIT brought 605 bytes but no reply of an NDI tracker"):
        started(bench)


def test_a_tracker_left_at_another_speed_is_brought_back_by_a_break() -> None:
    bench = TrackerBench(address="/dev/memory")
    bench.speed = 115200
    device = started(bench)
    assert bench.commands[:3] == [b"INIT:E3A5\r", b"<break>", b"INIT:E3A5\r"]
    assert bench.bauds == [9600, 115200]
    device.close()
    bench.release()


def test_a_tracker_left_fast_is_found_where_the_line_loses_breaks() -> None:
    bench = TrackerBench(address="/dev/memory")
    bench.speed = 115200
    bench.heeds_break = False
    device = started(bench)
    assert run(bench, device, 100, 130)
    device.close()
    bench.release()


def test_close_stops_tracking_once_and_may_be_called_twice(bench: TrackerBench) -> None:
    device = started(bench)
    run(bench, device, 100, 200)
    device.close()
    device.close()
    assert bench.commands[-1] == b"TSTOP:2C14\r"
    assert bench.commands.count(b"TSTOP:2C14\r") == 1
    assert bench.closed


def test_close_does_not_raise_on_a_cut_cable(bench: TrackerBench) -> None:
    device = started(bench)
    bench.cut = True
    device.close()
    assert bench.closed


def test_it_can_be_started_again_and_its_numbers_go_on(bench: TrackerBench) -> None:
    device = started(bench)
    before = run(bench, device, 100, 200)
    device.close()
    device.start()
    assert run(bench, device, 200, 300)[0].seq == before[-1].seq + 1


def test_a_tracker_left_tracking_by_a_host_that_died_is_taken_over(bench: TrackerBench) -> None:
    run(bench, started(bench), 100, 200)
    assert run(bench, started(bench), 200, 300)[0].valid == 1


ROM_COMMANDS = 2 * 17


def with_roms(bench: TrackerBench, folder: Path) -> NdiTracker:
    paths = (folder / "tip.rom", folder / "arm.rom")
    for path in paths:
        path.write_bytes(b"NDI\0")
    return started(bench, roms=paths)


@pytest.mark.parametrize("address", ["tcp://memory:1", "/dev/memory"])
@pytest.mark.parametrize("fault", ["spoil", "mishear"])
def test_any_one_reply_or_command_damaged_during_start_is_said_again(address: str, fault: str, tmp_path: Path) -> None:
    """Each in turn, tool definitions included; only the change of speed is not said again, nor need be."""
    for number in range(1, 100):
        bench = TrackerBench(address=address)
        setattr(bench, fault, {number})
        device = with_roms(bench, tmp_path)
        if number > len(bench.commands):
            break
        damaged = bench.commands[number - 1]
        if fault == "mishear" or not damaged.startswith(b"COMM"):
            assert bench.commands[number] == damaged, number
        assert [sample.valid for sample in run(bench, device, 100, 130)[:2]] == [1, 1], damaged
        device.close()
        assert bench.mock._ports.search("00").startswith("02")
        bench.release()
    assert number > ROM_COMMANDS


def test_three_damaged_replies_in_a_row_are_told_as_what_they_are(bench: TrackerBench) -> None:
    bench.spoil = {2, 3, 4}
    with pytest.raises(DeviceError, match=r"VER brought .* bytes but no reply .* and a good checksum"):
        started(bench)
    assert bench.commands.count(b"VER:065EE\r") == 3
    assert bench.closed
