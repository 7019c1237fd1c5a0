import array
import fcntl
import json
import math
import os
import resource
import select
import signal
import socket
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.bota.device import BotaSensOne
from drivers.epos4.device import Epos4Axis
from drivers.ports import Port, PortClosed, open_port, read_until
from mock_devices import played
from mock_devices.bench import Bench
from mock_devices.control import BenchControl, ControlPort, RequestHandler
from mock_devices.devices import DeviceFactory
from mock_devices.faults.wires import Fault
from mock_devices.interfaces import NEVER_NS
from mock_devices.parameters import Parameters
from mock_devices.played import made
from mock_devices.serve import MockServer, effects_table
from mock_devices.testing.clock import Clock
from mock_devices.testing.commands import served_bench
from mock_devices.testing.force import collect
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.products.ndi_polaris import PolarisWiring
from rig.config.products.registry import ROLES
from rig.config.wiring import Limits
from rig.errors import UsageError
from rig.plugins import Plugin

COMMAND = [sys.executable, "-m", "mock_devices.serve", "--tracker-tcp-port", "0"]
FRAME = 37
TERMINAL_BYTES = 4095  # what Linux hands out of one at most, however much lies there


@contextmanager
def started(*options: str) -> Iterator[tuple["subprocess.Popen[str]", dict[str, Any]]]:
    """The bench in another process, and the line it printed."""
    process = subprocess.Popen(
        [*COMMAND, *options], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdin and process.stdout and process.stderr
    try:
        yield process, json.loads(process.stdout.readline())
    finally:
        process.terminate()
        process.communicate(timeout=20)


@contextmanager
def opened(address: str) -> Iterator[Port]:
    port = open_port(address if address.startswith("/") else f"tcp://{address}", 115_200)
    try:
        yield port
    finally:
        port.close()


def reply(address: str, request: bytes, enough: Callable[[bytes], bool]) -> bytes:
    with opened(address) as port:
        port.write(request)
        return read_until(port, enough, 5.0)


def await_bytes(fileno: int, count: int) -> None:
    """Waits until ``count`` bytes lie at the descriptor."""
    waiting, deadline = array.array("i", [0]), time.monotonic() + 5.0
    while waiting[0] < count:
        assert time.monotonic() < deadline, f"only {waiting[0]} bytes"
        fcntl.ioctl(fileno, termios.FIONREAD, waiting)


def configured(port: Port) -> bool:
    """Asks for the configuration mode until the sensor has booted and agrees."""
    for _ in range(50):
        port.write(b"C")
        if b"r,0,C,0" in read_until(port, lambda data: b"r,0,C,0" in data, 0.1):
            return True
    return False


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
def test_one_line_tells_where_everything_is_and_every_product_answers_there() -> None:
    with started("--hide", "friction.level_N=0.2") as (process, endpoints):
        served = {product.mock.role for products in ROLES.values() for product in products.values() if product.mock}
        assert {"force", "force_modbus", "axis", "tracker"} <= served
        assert set(endpoints) == served | {"control", "pid", "serials", "latency_ms"}
        assert endpoints["pid"] == process.pid
        assert "friction" not in json.dumps(endpoints)
        with opened(endpoints["force"]["serial"]) as port:
            assert configured(port)
        forces = reply(
            endpoints["force_modbus"]["serial"], bytes.fromhex("09 03 00 B4 00 06 84 A6"), lambda data: len(data) >= 17
        )
        assert forces[:3] == bytes.fromhex("09 03 0C")
        assert len(forces) == 17
        for axis in ("axis", "axis_cia402"):
            assert reply(endpoints[axis]["slcan"], b"V\r", lambda data: data.endswith(b"\r"))[:1] == b"V"
        for address in endpoints["tracker"].values():
            assert reply(address, b"INIT \r", lambda data: data.endswith(b"\r")) == b"OKAYA896\r"


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
def test_a_running_bench_is_read_turned_and_broken_through_its_control_channel() -> None:
    with (
        started("--hide", "friction.level_N=0.3", "--seed", "5") as (_, endpoints),
        BenchControl(endpoints["control"]) as control,
        opened(endpoints["force"]["serial"]) as port,
    ):
        assert control.truth() == {"friction": {"level_N": 0.3, "slip_length_mm": 0.05}}
        assert control.number("axis.position_mm") == 5.0
        first_s = control.number("time_s")
        control.set({"surface.position_mm": 4.0})
        while control.number("surface.position_mm") != 4.0:
            time.sleep(0.02)
        assert control.number("tip.depth_mm") == pytest.approx(1.0, abs=1e-6)
        assert control.number("tip.force_N") == pytest.approx(0.12 * 1.2461, abs=1e-3)
        assert control.number("time_s") > first_s
        control.fault("force", "cut")
        with pytest.raises(PortClosed):
            read_until(port, bool, 5.0)


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
def test_the_force_driver_gets_its_thousand_samples_a_second_from_the_bench() -> None:
    with started() as (_, endpoints), opened(endpoints["force"]["serial"]) as port:
        sensor = BotaSensOne(port, BotaWiring(port=endpoints["force"]["serial"]))
        sensor.start()
        samples = collect(sensor, lambda got: len(got) >= 800)
        sensor.close()
    taken_us = samples[-1].device_us - samples[0].device_us
    assert taken_us / (len(samples) - 1 + sensor.counters.device_lost) == pytest.approx(1000, rel=0.01)
    assert sum(sample.fz_N for sample in samples) / len(samples) == pytest.approx(0.8, abs=0.005)


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
def test_the_axis_driver_homes_and_moves_the_tip_into_the_tissue() -> None:
    with started() as (_, endpoints), BenchControl(endpoints["control"]) as control:
        axis = Epos4Axis(Epos4Wiring(port=endpoints["axis"]["slcan"], heartbeat_ms=1000), Limits())
        try:
            axis.start()
            axis.home()
            axis.move_to(24.0, 30.0)
            assert control.number("axis.position_mm") == pytest.approx(24.0, abs=0.1)
            assert control.number("tip.force_N") == pytest.approx(0.12 * 4 * 2.41, abs=0.15)
            assert control.get("axis.powered") == {"axis.powered": True}
        finally:
            axis.close()
        while control.get("axis.powered")["axis.powered"]:
            time.sleep(0.02)


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_ends_cleanly_when_told_to(number: signal.Signals) -> None:
    with started() as (process, endpoints):
        process.send_signal(number)
        assert process.wait(20) == 0
        with pytest.raises(OSError, match="refused"):
            socket.create_connection(("127.0.0.1", int(endpoints["control"].rpartition(":")[2])), 1)


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
def test_it_ends_when_its_parent_is_gone() -> None:
    with started("--with-parent") as (process, _):
        assert process.stdin
        process.stdin.close()
        assert process.wait(20) == 0
        process.stdin = None


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
def test_one_force_product_alone_and_a_taken_tracker_port_are_both_said_in_the_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        number = taken.getsockname()[1]
        with started("--force", "robotiq-ft300", "--tracker-tcp-port", str(number)) as (_, endpoints):
            assert "force" not in endpoints
            assert endpoints["force_modbus"]["serial"].startswith("/dev/")
            assert endpoints["tracker"]["tcp"] != f"127.0.0.1:{number}"


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
def test_a_bench_of_real_time_priority_keeps_its_memory() -> None:
    may_lock_bytes = resource.getrlimit(resource.RLIMIT_MEMLOCK)[1]
    if os.geteuid() != 0 and may_lock_bytes != resource.RLIM_INFINITY:
        pytest.skip("locked memory is not granted here")
    with served_bench() as bench:
        status = Path(f"/proc/{bench.endpoints.pid}/status").read_text()
    locked_kB = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmLck:"))
    assert locked_kB > 10_000


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--hide", "fricton.level_N=1"], "nearest valid effect: friction"),
        (["--parameters", "no-such.toml"], "no-such.toml: no such file"),
    ],
)
def test_wrong_use_ends_with_2_and_one_sentence(options: list[str], sentence: str) -> None:
    ended = subprocess.run([*COMMAND, *options], capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert sentence in ended.stderr
    assert ended.stderr.count("\n") == 1


def test_the_list_of_effects_names_each_parameter_with_default_and_bounds() -> None:
    assert "    friction.level_N=0.2    0 to 5: Coulomb level\n" in effects_table()


class ServerBench:
    """A server on an injected clock, and the client's end of its force sensor's line; ``whose`` that sensor is."""

    def __init__(self, whose: Plugin | None = None) -> None:
        self.clock = Clock(0)
        self.bench = Bench(Parameters.model_validate({"tracker": {"tcp_port": 0}, "force": {"counter_drift_ppm": 0.0}}))
        factory = DeviceFactory(self.bench, 0, self.clock, seed=0)
        ours = made((BotaWiring, Epos4Wiring, PolarisWiring), factory)
        devices = [replace(ours[0], whose=whose), *ours[1:]]
        self.sensor, self.line, self.axis = devices[0], devices[0].wire, devices[1]
        self.server = MockServer(self.bench, devices, self.clock)
        self.port = open_port(self.line.endpoint, 460_800)
        self.server.turn([fileno for one in devices for fileno in one.mock.filenos()])  # the sensor has power from here

    def pass_ms(self, milliseconds: int) -> None:
        self.clock.now_ns += milliseconds * 1_000_000
        self.server.turn([])

    def say(self, data: bytes) -> bytes:
        """What the sensor says until it has answered; boot text and samples may come in parts of their own."""
        self.write(data)
        self.server.turn(self.line.filenos())
        answered = b",%c,0\r\n" % data[0]
        return read_until(self.port, lambda answer: answer.endswith(answered), 5.0)

    def write(self, data: bytes) -> None:
        self.port.write(data)
        assert select.select(self.line.filenos(), [], [], 5.0)[0]

    def frames(self, expected: int) -> int:
        """Frames on the line since the last call, waiting for those ``expected``."""
        data = read_until(self.port, lambda data: len(data) >= expected * FRAME, 5.0)
        assert data[::FRAME] == b"\xaa" * (len(data) // FRAME)
        return len(data) // FRAME


@contextmanager
def streaming(served: ServerBench) -> Iterator[ServerBench]:
    """Past its boot text, streaming at 100 Hz since 0.3 s."""
    try:
        served.pass_ms(300)
        served.say(b"C")
        served.say(b"f,512,0,0,1")
        assert served.say(b"R") == b"r,0,R,0\r\n"
        yield served
    finally:
        served.port.close()
        served.server.close()


@pytest.fixture
def served() -> Iterator[ServerBench]:
    with streaming(ServerBench()) as served:
        yield served


@pytest.fixture
def anothers() -> Iterator[ServerBench]:
    """The same, its force sensor a plug-in's."""
    with streaming(ServerBench(Plugin("tissue_rig.force", "x", "acme-rig", "2.1", "acme-one"))) as served:
        yield served


def raising(error: BaseException) -> Callable[..., None]:
    def raises(*_: object) -> None:
        raise error

    return raises


@pytest.mark.parametrize("error", [KeyError("counts"), SystemExit("dongle"), ValueError("two\nlines")], ids=repr)
@pytest.mark.parametrize("method", ["tick", "receive", "filenos", "close"])
def test_a_plug_ins_mock_that_raises_is_named_once_and_silent_and_the_others_go_on(
    anothers: ServerBench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], method: str,
    error: BaseException,
) -> None:  # fmt: skip
    anothers.pass_ms(100)
    assert anothers.frames(10) == 10
    with opened(anothers.axis.wire.endpoint) as port:
        monkeypatch.setattr(anothers.sensor.mock, method, raising(error))
        if method == "receive":
            anothers.write(b"C")
        for _ in range(3):
            anothers.clock.now_ns += 100_000_000
            anothers.server.turn(anothers.line.filenos())
        port.write(b"V\r")
        assert select.select(anothers.axis.wire.filenos(), [], [], 5.0)[0]
        anothers.server.turn(anothers.axis.wire.filenos())
        assert read_until(port, lambda data: data.endswith(b"\r"), 5.0)[:1] == b"V"
    if method == "close":
        anothers.server.close()
    said = " ".join(f"{type(error).__name__}: {error}".split())
    assert capsys.readouterr().err == (
        "bench: tissue_rig.force 'x' of acme-rig 2.1: its mock at force is silent from now on, as a lost device,"
        f" for it raised {said}; see its maker\n"
    )
    assert anothers.bench.time_s == pytest.approx(0.7, abs=0.01)
    if method != "close":
        assert read_until(anothers.port, bool, 0.2) == b""


def test_a_plug_ins_mock_that_never_comes_back_or_on_is_silent_too(
    anothers: ServerBench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(played, "TURN_S", 0.1)
    monkeypatch.setattr(anothers.sensor.mock, "receive", lambda _: time.sleep(60))
    anothers.server.turn(anothers.line.filenos())
    assert "for it raised TimeoutError: not done within 0.1 s; see" in capsys.readouterr().err


def test_a_plug_ins_mock_whose_time_stands_still_is_silent_too(
    anothers: ServerBench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(anothers.sensor.mock, "tick", lambda _: None)
    due_ns = anothers.sensor.mock.due_ns
    anothers.pass_ms(100)
    assert f"TimeoutError: due_ns stays at {due_ns} whatever it has done; see" in capsys.readouterr().err
    assert anothers.bench.time_s == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize(("due", "next_ns"), [(10.2, 11), (10, 10), (math.inf, NEVER_NS)])
def test_a_plug_ins_mock_may_be_due_between_two_nanoseconds_or_never(
    anothers: ServerBench, monkeypatch: pytest.MonkeyPatch, due: float, next_ns: int
) -> None:
    monkeypatch.setattr(type(anothers.sensor.mock), "due_ns", due)
    assert anothers.sensor.player.due_ns == next_ns


def test_a_mock_of_ours_that_raises_is_our_own_mistake_and_ends_the_bench(
    served: ServerBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(served.sensor.mock, "tick", raising(KeyError("counts")))
    with pytest.raises(KeyError):
        served.pass_ms(100)


def test_a_fault_that_raises_is_refused_and_the_bench_goes_on(anothers: ServerBench) -> None:
    anothers.sensor.faults["drop"] = Fault("is lost", True, raising(KeyError("share")))
    anothers.server.control.close()
    said: list[str] = []
    port = ControlPort(RequestHandler(anothers.bench, {"force": [anothers.sensor.faults]}).answer)

    def ask() -> None:
        with BenchControl(port.endpoint) as control, pytest.raises(UsageError) as told:
            control.fault("force", "drop")
        said.append(str(told.value))

    asking = threading.Thread(target=ask)
    asking.start()
    while asking.is_alive():
        select.select(port.filenos(), [], [], 0.01)
        port.receive()
    port.close()
    assert said == ["fault failed, KeyError: 'share'"]


def test_each_mock_acts_at_its_own_time_after_physics_has_come_there(served: ServerBench) -> None:
    served.pass_ms(105)
    assert served.frames(10) == 10
    assert 0.400 <= served.bench.time_s <= 0.405


def test_a_short_stall_is_caught_up_sample_by_sample(served: ServerBench) -> None:
    served.pass_ms(900)
    assert served.frames(90) == 90
    assert served.bench.time_s == pytest.approx(1.2, abs=0.01)


def test_after_a_long_stall_physics_goes_on_from_now_and_says_so(
    served: ServerBench, capsys: pytest.CaptureFixture[str]
) -> None:
    served.pass_ms(5000)
    assert served.bench.time_s == pytest.approx(0.3)
    assert served.bench.now_ns == pytest.approx(served.clock.now_ns, abs=250_000)
    assert "stopped for 5.0 s" in capsys.readouterr().err
    read_until(served.port, lambda _: False, 0.2)
    served.pass_ms(100)
    assert served.frames(10) == 10
    assert served.bench.time_s == pytest.approx(0.4, abs=0.01)


def test_bytes_that_came_during_a_stall_are_heard_before_time_is_caught_up(served: ServerBench) -> None:
    served.clock.now_ns += 500_000_000
    assert served.say(b"C") == b"r,0,C,0\r\n"


@dataclass
class ToldAxis:
    """A client of the axis whose channel is open, and when each of its lines was heard."""

    served: ServerBench
    port: Port
    heard_ns: list[int] = field(default_factory=list)

    @property
    def filenos(self) -> list[int]:
        """Of the axis' line."""
        return self.served.axis.wire.filenos()

    def turn(self) -> None:
        """With something on the line."""
        assert select.select(self.filenos, [], [], 5.0)[0]
        self.served.server.turn(self.filenos)

    def tell(self, lines: int, stall_ms: int) -> None:
        """Puts ``lines`` SYNCs on the line while ``stall_ms`` pass."""
        self.port.write(b"t0800\r" * lines)
        await_bytes(self.filenos[0], min(lines * 6, TERMINAL_BYTES))
        self.served.clock.now_ns += stall_ms * 1_000_000


@pytest.fixture
def told(served: ServerBench, monkeypatch: pytest.MonkeyPatch) -> Iterator[ToldAxis]:
    """A node that is operational."""
    hear = served.axis.mock.receive
    with opened(served.axis.wire.endpoint) as port:
        told = ToldAxis(served, port)
        port.write(b"C\rS8\rO\rt00020101\r")
        told.turn()

        def heard(now_ns: int) -> None:
            told.heard_ns.append(now_ns)
            hear(now_ns)

        monkeypatch.setattr(served.axis.mock, "receive", heard)
        yield told


def test_what_the_axis_was_told_during_a_stall_is_heard_evenly_over_it(told: ToldAxis) -> None:
    clock = told.served.clock
    before_ns = clock.now_ns
    told.tell(lines=50, stall_ms=100)
    told.turn()
    steps_ns = np.diff([before_ns, *told.heard_ns])
    assert len(told.heard_ns) == 50
    assert steps_ns == pytest.approx([0, *[2_000_000] * 49], abs=300_000)
    assert told.served.bench.now_ns == pytest.approx(clock.now_ns, abs=5_000_000)


def test_more_than_a_terminal_hands_out_at_once_is_heard_evenly_too(told: ToldAxis) -> None:
    told.tell(lines=900, stall_ms=900)
    told.turn()
    assert np.diff(told.heard_ns) == pytest.approx([1_000_000] * 899, abs=300_000)


def test_what_the_axis_was_told_while_a_turn_was_held_up_is_not_heard_all_at_once(
    told: ToldAxis, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process loses its core just after it has looked at the clock, and fifty lines come before it goes on."""
    server, clock = told.served.server, told.served.clock
    looks = 0

    def held_up() -> int:
        nonlocal looks
        looks, looked_ns = looks + 1, clock.now_ns
        if looks == 2:  # the first is followed by a look whether more came
            told.tell(lines=50, stall_ms=100)
        return looked_ns

    told.port.write(b"t0800\r")
    monkeypatch.setattr(server, "_clock_ns", held_up)
    told.turn()
    told.turn()
    assert len(told.heard_ns) == 51
    assert np.diff(told.heard_ns[1:]) == pytest.approx(2_000_000, abs=300_000)


@pytest.mark.parametrize("after", ["waiting", "reading"])
def test_a_turn_that_is_held_up_before_it_looks_at_the_clock_hears_all_that_came(
    told: ToldAxis, monkeypatch: pytest.MonkeyPatch, after: str
) -> None:
    """It woke for something else, or had just found nothing on the line, as it lost its core."""
    wire = told.served.axis.wire
    read, reads = wire.read, 0

    def held_up() -> bytes:
        nonlocal reads
        reads += 1
        came = b"" if after == "reading" and reads == 1 else read()
        if after == "reading" and reads == 1:
            told.tell(lines=50, stall_ms=100)
        return came

    if after == "waiting":
        told.tell(lines=50, stall_ms=100)
    monkeypatch.setattr(wire, "read", held_up)
    told.served.server.turn([])
    monkeypatch.setattr(wire, "read", read)
    assert len(told.heard_ns) == 50
    assert np.diff(told.heard_ns) == pytest.approx(2_000_000, abs=300_000)


def test_a_bench_keeps_off_the_core_that_the_loop_takes_first() -> None:
    cores = os.sched_getaffinity(0)
    with served_bench() as bench:
        assert os.sched_getaffinity(bench.endpoints.pid) == (cores - {max(cores)} or cores)
