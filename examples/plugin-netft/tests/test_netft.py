"""The Net F/T: its bytes against the maker's layout, and the conformance kit on the simulated sensor."""

import struct
from collections.abc import Callable
from pathlib import Path

import pytest
from rig_netft.netft import NetFt, NetFtWiring, Scale, open_sensor, parse, request, scale_of

from controller.devices import finding
from controller.replay.session import replay
from drivers.roles import Identity
from drivers.testing import CHECKS, UnderTest
from drivers.testing.checks import quantities
from mock_devices.testing.commands import EXAMPLES
from mock_devices.testing.hand import MockBench
from rig.errors import DeviceError, UsageError
from rig.recording.reader import read_recording

NETFT = "force.product=ati-netft"
MODEL = EXAMPLES / "forearm-model.json"
# Sequence 5, clock 35,007, healthy, 1, -2, 3 million and 100, -200, 300 thousand counts: written out by hand.
RECORD = bytes.fromhex("00000005 000088bf 00000000 000f4240 ffe17b80 002dc6c0 000186a0 fffcf2c0 000493e0")
UNITS = "<scfgfu>{}</scfgfu><scfgtu>{}</scfgtu><cfgcpf>{}</cfgcpf><cfgcpt>{}</cfgcpt>"
PAGE = f"<netft><cfgcalsn>FT27462</cfgcalsn>{UNITS}</netft>"


def test_requests_are_the_makers_bytes() -> None:
    assert request(2) == bytes.fromhex("1234 0002 00000000")
    assert request(0) == bytes.fromhex("1234 0000 00000000")
    assert request(2, 258) == bytes.fromhex("1234 0002 00000102")


def test_a_record_is_read_as_it_was_written() -> None:
    assert parse(RECORD) == (5, 35007, 0, (1_000_000, -2_000_000, 3_000_000, 100_000, -200_000, 300_000))


@pytest.mark.parametrize("wrong", [b"", RECORD[:-1], RECORD + b"\0", RECORD * 2])
def test_a_datagram_of_another_length_is_no_record(wrong: bytes) -> None:
    assert parse(wrong) is None


@pytest.mark.parametrize(
    ("page", "per_count_N", "per_count_N_m"),
    [
        (("N", "Nm", 1_000_000, 1_000_000), 1e-6, 1e-6),
        (("lbf", "lbf-in", 1000, 500), 4.4482216152605e-3, 2.259696580552334e-4),
    ],
)
def test_counts_become_newton_by_what_the_page_says(
    page: tuple[str, str, int, int], per_count_N: float, per_count_N_m: float
) -> None:
    scale = scale_of(PAGE.format(*page), "ati-netft")
    assert (scale.N, scale.N_m) == (pytest.approx(per_count_N), pytest.approx(per_count_N_m))
    assert scale.identity == Identity("Net F/T", "FT27462", "")


@pytest.mark.parametrize(
    "page",
    [
        PAGE.format("stone", "Nm", 1, 1),
        *(PAGE.format("N", "Nm", counts, 1) for counts in (0, "x", "nan", -1, "1e999")),
        PAGE.format("N", "Nm", 1, "nan"),
        "<html>",
    ],
)
def test_a_page_without_a_scale_is_refused(page: str) -> None:
    with pytest.raises(DeviceError, match=r"ati-netft: netftapi2.xml says no .* set its units to N and Nm"):
        scale_of(page, "ati-netft")


class Datagrams:
    """Stands for the port: datagrams as they come."""

    address = "memory"

    def __init__(self, *given: bytes) -> None:
        self.given = list(given)

    def datagrams(self) -> list[bytes]:
        given, self.given = self.given, []
        return given


def record(rdt: int, tick: int, status: int = 0) -> bytes:
    return struct.pack(">IIIiiiiii", rdt, tick, status, 1_000_000, 0, 0, 0, 0, 0)


def sensor(*given: bytes) -> NetFt:
    made = NetFt(Datagrams(*given), NetFtWiring(), lambda _: "", now=lambda: 10_000_000_000)  # type: ignore[arg-type]
    made._scale = Scale(1e-6, 1e-6, Identity("", "", ""))
    return made


def test_loss_repetition_and_overtaking_are_counted_and_wrapping_is_none() -> None:
    made = sensor(record(0xFFFFFFFF, 100), record(0, 107), record(0, 107), record(3, 128), record(2, 121), b"short")
    samples = made.poll(10_000_000_000)
    assert [sample.device_us for sample in samples] == [100_000_000 // 7000, 107_000_000 // 7000, 128_000_000 // 7000]
    counted = made.counters
    assert (counted.frames, counted.device_lost, counted.repeated, counted.discarded_bytes) == (3, 2, 2, 5)


def test_what_the_sensor_marks_as_unhealthy_is_invalid() -> None:
    good, bad = sensor(record(1, 7), record(2, 14, 0x80000000)).poll(10_000_000_000)
    assert (good.valid, bad.valid, good.fx_N) == (1, 0, 1.0)


@pytest.mark.parametrize(
    ("asked_Hz", "given_Hz"), [(1000, 1000.0), (999, 1000.0), (2000, 7000 / 3), (7000, 7000.0), (10, 10.0)]
)
def test_rates_are_parts_of_its_clock(asked_Hz: float, given_Hz: float) -> None:
    assert NetFtWiring(rate_Hz=asked_Hz).sampled_Hz == pytest.approx(given_Hz)


def test_a_port_that_is_no_network_address_is_one_sentence() -> None:
    with pytest.raises(UsageError, match=r"force.port /dev/ttyUSB0: an ati-netft is at udp://HOST:49152"):
        open_sensor(NetFtWiring(port="/dev/ttyUSB0"))


@pytest.fixture
def subject(mock_bench: MockBench) -> UnderTest:
    config = mock_bench.wiring(NETFT).force
    assert isinstance(config, NetFtWiring)
    return UnderTest(
        config,
        lambda: open_sensor(config),
        lambda kind, value: mock_bench.fault("netft", kind, value),
        damage=("drop", "truncate", "garbage"),  # UDP's own checksum keeps flipped bits away
        load=mock_bench.load,
    )


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_it_conforms(check: Callable[[UnderTest], None], subject: UnderTest) -> None:
    check(subject)


def test_a_sensor_that_counts_in_pounds_is_read_in_newton(mock_bench: MockBench, subject: UnderTest) -> None:
    mock_bench.fault("netft", "pounds", True)
    try:
        quantities(subject)
    finally:
        mock_bench.fault("netft", "pounds", False)


def test_doctor_sees_it_beside_ours(mock_bench: MockBench, tmp_path: Path) -> None:
    said = mock_bench.rig("doctor", folder=tmp_path, settings=(NETFT,))
    assert said.code == 0, said.err
    assert "Net F/T" in said.out and "EPOS4" in said.out.upper()


def test_find_names_it_at_its_address_after_products_that_speak_otherwise(mock_bench: MockBench) -> None:
    found = finding.ask(finding.named(mock_bench.wiring(NETFT).force.port))
    assert (found.role, found.product, found.serial, found.problem) == ("force", "ati-netft", "FT27462", "")


def test_capture_and_track_on_a_mixed_bench(mock_bench: MockBench, tmp_path: Path) -> None:
    (tmp_path / "one.toml").write_text("speeds_mm_s = [10]\ntrials = 1\ndepth_mm = 6\n")
    done = mock_bench.rig("capture", tmp_path / "one.toml", "--out", "session", folder=tmp_path, settings=(NETFT,))
    assert done.code in (0, 4), done.err
    recording = read_recording(tmp_path / "session" / "trial_001.mcap")
    assert "FT27462" in recording.metadata["devices"]["force"]
    assert recording.tables["force"]["device_us"].max() > 0
    tracking = ("track", "--model", MODEL, "--force", "2", "--seconds", "2", "--out", "run")
    tracked = mock_bench.rig(*tracking, folder=tmp_path, settings=(NETFT,))
    assert tracked.code in (0, 4), tracked.err
    assert replay(tmp_path / "run").identical
