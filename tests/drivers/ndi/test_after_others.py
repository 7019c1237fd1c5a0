"""Whether INIT frees what a session leaves behind or not, ours leaves nothing and starts after whatever came before."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from drivers.ndi import codec
from drivers.ndi.device import NdiTracker
from mock_devices.testing.ndi import TrackerBench, run, started
from rig.config.products.ndi_polaris import PolarisWiring

ROM = b"NDI\0".ljust(1024, b"\x07")


@pytest.fixture(params=[False, True], ids=["INIT frees", "INIT keeps"])
def bench(request: pytest.FixtureRequest) -> Iterator[TrackerBench]:
    bench = TrackerBench()
    bench.mock.keeps_handles = request.param
    yield bench
    bench.release()


@pytest.fixture
def roms(tmp_path: Path) -> tuple[Path, Path]:
    paths = tmp_path / "tip.rom", tmp_path / "arm.rom"
    for path in paths:
        path.write_bytes(ROM)
    return paths


def said(bench: TrackerBench, *commands: str) -> list[str]:
    """What the tracker answers to another client's commands."""
    answers = []
    for command in commands:
        name, _, params = command.partition(":")
        bench.write(codec.encode_command(name, params))
        (reply,) = codec.ReplyDecoder().feed(bench.read())
        answers.append(reply.text if isinstance(reply, codec.TextReply) else "")
    return answers


def handles(bench: TrackerBench) -> str:
    return said(bench, "PHSR:00")[0][:2]


def other_client(bench: TrackerBench) -> None:
    """As scikit-surgerynditracker does it: loads, enables, tracks, stops, and frees nothing."""
    said(bench, "INIT:")
    for _ in range(2):
        (handle,) = said(bench, "PHRQ:*********1****")
        assert len(handle) == 2
        for at in range(0, 1024, 64):
            said(bench, f"PVWR:{handle}{at:04X}{ROM[at : at + 64].hex().upper()}")
        assert said(bench, f"PINIT:{handle}", f"PENA:{handle}D") == ["OKAY", "OKAY"]
    assert said(bench, "TSTART:80", "TSTOP:") == ["OKAY", "OKAY"]


def killed_while_loading(bench: TrackerBench) -> None:
    said(bench, "INIT:", "PHRQ:*********1****", f"PVWR:030000{ROM[:64].hex()}")


def killed_while_tracking(bench: TrackerBench) -> None:
    other_client(bench)
    said(bench, "TSTART:")


BEFORE: tuple[Callable[[TrackerBench], None], ...] = (other_client, killed_while_loading, killed_while_tracking)


@pytest.mark.parametrize("before", [*BEFORE, lambda bench: [session(bench) for session in BEFORE * 3]])
@pytest.mark.parametrize("with_roms", [False, True])
def test_it_starts_and_sees_both_tools(
    bench: TrackerBench, roms: tuple[Path, Path], before: Callable[[TrackerBench], None], with_roms: bool
) -> None:
    before(bench)
    device = started(bench, roms=roms if with_roms else ())
    assert [(sample.tool, sample.valid) for sample in run(bench, device, 100, 130)[:2]] == [(0, 1), (1, 1)]
    device.close()


def test_closing_frees_what_was_loaded_and_leaves_the_ports_as_they_were(
    bench: TrackerBench, roms: tuple[Path, Path]
) -> None:
    said(bench, "INIT:")
    assert handles(bench) == "02"
    for _ in range(3):
        device = started(bench, roms=roms)
        run(bench, device, 100, 130)
        device.close()
        assert bench.commands[-3:] == [codec.encode_command("TSTOP"), *freed(3, 4)]
    said(bench, "INIT:")
    assert handles(bench) == "02"


def freed(*numbers: int) -> list[bytes]:
    return [codec.encode_command("PHF", f"{number:02X}") for number in numbers]


def test_a_start_that_fails_while_loading_frees_what_it_had_loaded(
    bench: TrackerBench, roms: tuple[Path, Path]
) -> None:
    bench.canned = {"PENA": "ERROR0E"}
    with pytest.raises(Exception, match="refused PENA"):
        started(bench, roms=roms)
    assert bench.commands[-2:] == freed(3, 4)


def test_after_our_sessions_another_client_finds_its_markers(bench: TrackerBench, roms: tuple[Path, Path]) -> None:
    """And after its own: what an earlier session left does not keep the later one's tools from the camera."""
    started(bench, roms=roms).close()
    for _ in range(3):
        other_client(bench)
        said(bench, "TSTART:")
        bench.run_until(1_000_000_000)
        tracked = said(bench, "TX:0001")[0]
        assert "MISSING" not in tracked
        said(bench, "TSTOP:")


def test_who_only_asks_who_is_there_loads_nothing_and_lets_nothing_go(bench: TrackerBench) -> None:
    other_client(bench)
    bench.commands.clear()
    found = NdiTracker(bench.open, PolarisWiring(tools=("another",)), lambda: 0).identify()
    assert found.product == "Polaris Vega Control Firmware"
    assert {command.split(b":")[0] for command in bench.commands} == {b"INIT", b"VER", b"GETINFO"}
    assert bench.closed
