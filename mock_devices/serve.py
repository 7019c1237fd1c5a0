"""The process behind `rig mock`: every device of the bench on its wire, in real time, until it is told to end.

It prints one JSON line with all endpoints when it is ready, and nothing else on that channel. One thread: it sleeps
until the next mock is due or bytes have come, integrates physics exactly to that time, and lets the mock act.
"""

import argparse
import contextlib
import gc
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from mock_devices.bench import Bench
from mock_devices.control import ControlPort, RequestHandler
from mock_devices.devices import DeviceFactory
from mock_devices.epos4.mock import Epos4Mock
from mock_devices.faults.wires import Fault
from mock_devices.parameters import Parameters, load_parameters
from mock_devices.physics.effects import EFFECTS, complete, knobs, parse_hidden, statement
from mock_devices.played import ALL, CHOICES, MockDevice, made
from mock_devices.stating import Numbered, Sampled, StatedLatency
from rig.config.endpoints import Endpoints
from rig.config.products.inputs import INPUTS
from rig.config.products.registry import AXES
from rig.errors import RigError
from rig.realtime import ask_fifo, lock_memory, shorten_timer_slack

# A client's bytes that came during a stall were sent before its end: they are heard before time is caught up, or every
# stall of this process would look like a lost heartbeat. What the axis was told is heard line by line over the stall:
# else the carriage would stand still, then jump, and force-displacement curves would show how busy the computer was.
LATE_NS = 5_000_000
GIVE_UP_NS = 1_000_000_000  # a busy computer stalls for tenths of a second: this process was stopped
NAP_S = 0.1  # of physics are 1.2 ms of work, which is in time (LATE_NS)
# Physics of many milliseconds take a few tenths of one, by which a sample would come late: they are made up for before.
LEAD_S = 0.001
# All devices have booted when the endpoints are printed.
POWERED_BEFORE_NS = 500_000_000
AXIS_ROLES = {axis.mock.role for axis in AXES.values() if axis.mock}


class Timed(Protocol):
    """What wants to act at a time of its own: a mock, or a wire that delays."""

    @property
    def due_ns(self) -> int:
        """When ``tick`` is next to be called."""

    def tick(self, now_ns: int) -> None:
        """Does what is due."""


class MockServer:
    """Bench, devices and control channel on one clock."""

    def __init__(self, bench: Bench, devices: Sequence[MockDevice], clock_ns: Callable[[], int]) -> None:
        self._bench = bench
        self._players = [device.player for device in devices]
        self._timed: list[Timed] = [*self._players, *(device.wire for device in devices)]
        self._devices = devices
        self._axes = [device for device in devices if device.role in AXIS_ROLES]
        self._axis = self._axes[0]
        self._clock_ns = clock_ns
        drives = [device.mock for device in devices if isinstance(device.mock, Epos4Mock)]
        synced_ns = drives[0].synced_ns if drives else None
        sampled = {device.role: device.mock.sampled for device in devices if isinstance(device.mock, Sampled)}
        self.control = ControlPort(RequestHandler(bench, _by_role(devices), synced_ns, sampled).answer)

    def endpoints(self) -> Endpoints:
        """Where all of it is."""
        addresses: dict[str, dict[str, str]] = {}
        serials: dict[str, str] = {}
        for device in self._devices:
            addresses.setdefault(device.role, {}).update(device.mock.endpoints())
            if isinstance(device.mock, Numbered):
                serials[device.role] = device.mock.serial_number
        about = {"control": self.control.endpoint, "pid": os.getpid(), "serials": serials}
        late = {
            device.role: device.mock.latency_ms for device in self._devices if isinstance(device.mock, StatedLatency)
        }
        stated = stated_latency_ms(self._bench.parameters) | late
        return Endpoints.model_validate(addresses | about | {"latency_ms": stated})

    def serve(self, ended: Callable[[], bool], parent: int | None = None) -> None:
        """Plays until ``ended``, or until the pipe ``parent`` is closed at its other end."""
        while not ended():
            ready = self._wait(parent)
            if parent is not None and parent in ready and not os.read(parent, 4096):
                return
            self.turn(ready)

    def turn(self, ready: Sequence[int]) -> None:
        """Brings time up to now and hears what came on the descriptors ``ready``."""
        axes = (device for device in self._axes if not set(device.wire.filenos()).isdisjoint(ready))
        self._axis = next(axes, self._axis)
        due_ns = self._due_ns()
        told, now_ns = self._told(due_ns)
        heard = {*ready, *(self._axis.wire.filenos() if told else ())}
        late = bool(heard) and now_ns - due_ns > LATE_NS
        if late:
            self._live_through(heard, told, now_ns)
        self._catch_up(now_ns)
        if not late:
            self._axis.wire.put_back(told)
            self._bench.advance(now_ns)
            self._hear(heard, now_ns)

    def close(self) -> None:
        """Cuts all wires."""
        for mock in self._players:
            mock.close()
        self.control.close()

    def _told(self, since_ns: int) -> tuple[bytes, int]:
        """All that the axis was told until a time, and that time; ``since_ns`` is when this turn was due.

        This process may be held up at any line of it, and a terminal hands out 4095 bytes at once: it reads until
        nothing is left and that took no time. What comes after belongs to the next turn.
        """
        told = b""
        while True:
            came, now_ns = self._axis.wire.read(), self._clock_ns()
            told += came
            if not came and now_ns - since_ns <= LATE_NS:
                return told, now_ns
            since_ns = now_ns

    def _due_ns(self) -> int:
        return min(item.due_ns for item in self._timed)

    def _wait(self, parent: int | None) -> list[int]:
        descriptors = [fileno for mock in self._players for fileno in mock.filenos()] + self.control.filenos()
        if parent is not None:
            descriptors.append(parent)
        left_s = (self._due_ns() - self._clock_ns()) * 1e-9
        if left_s > 2 * LEAD_S:
            left_s -= LEAD_S
        return select.select(descriptors, [], [], min(max(left_s, 0.0), NAP_S))[0]

    def _live_through(self, heard: set[int], told: bytes, now_ns: int) -> None:
        """Hears what came during a stall, what the axis was ``told`` line by line, evenly from its beginning on."""
        self._hear(heard.difference(self._axis.wire.filenos()), now_ns)
        start_ns, lines = self._bench.now_ns, told.splitlines(keepends=True)
        stall_ns = now_ns - start_ns if now_ns - start_ns < GIVE_UP_NS else 0
        for number, line in enumerate(lines):
            told_ns = start_ns + stall_ns * number // len(lines)
            self._catch_up(told_ns)
            self._bench.advance(told_ns)
            self._axis.wire.put_back(line)
            self._axis.player.receive(told_ns)

    def _hear(self, heard: set[int], now_ns: int) -> None:
        for mock in self._players:
            if not heard.isdisjoint(mock.filenos()):
                mock.receive(now_ns)
        if not heard.isdisjoint(self.control.filenos()):
            self.control.receive()

    def _catch_up(self, now_ns: int) -> None:
        gap_ns = now_ns - self._bench.now_ns
        if gap_ns > GIVE_UP_NS:
            sys.stderr.write(
                f"bench: stopped for {gap_ns * 1e-9:.1f} s; physics goes on from now, not through the gap\n"
            )
            self._bench.skip(gap_ns)
        while True:
            first = min(self._timed, key=lambda item: item.due_ns)
            if first.due_ns > now_ns:
                return
            self._bench.advance(first.due_ns)
            first.tick(first.due_ns)


def stated_latency_ms(parameters: Parameters) -> dict[str, float]:
    """From event to sample, by role: a first-order filter is late by its time constant, the camera by its own."""
    return {
        "force": 1e3 * parameters.force.filter_s,
        "force_modbus": 1e3 * parameters.force_modbus.filter_s,
        "tracker": 1e3 * parameters.tracker.latency_s,
    }


def _by_role(devices: Sequence[MockDevice]) -> dict[str, list[dict[str, Fault]]]:
    roles: dict[str, list[dict[str, Fault]]] = {}
    for device in devices:
        roles.setdefault(device.role, []).append(dict(device.faults))
    return roles


def main(arguments: Sequence[str] | None = None) -> int:
    """Serves the bench until SIGTERM, SIGINT or the parent's end; 0, or 2 with one sentence for wrong use."""
    options = _parser().parse_args(arguments)
    if options.list_effects:
        sys.stdout.write(effects_table())
        return 0
    ended: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _: ended.append(received))
    try:
        server = _server(options)
    except RigError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    with contextlib.closing(server):
        _be_prompt(options.priority)
        server.turn([])
        sys.stdout.write(server.endpoints().model_dump_json() + "\n")
        sys.stdout.flush()
        server.serve(lambda: bool(ended), sys.stdin.fileno() if options.with_parent else None)
    return 0


def effects_table() -> str:
    """Every effect that can be hidden, its parameters, their defaults and bounds."""
    lines = []
    for effect in EFFECTS:
        lines.append(f"{effect}: {statement(effect)}")
        for name, knob in knobs(effect).items():
            lines.append(f"    {effect}.{name}={knob.default:g}    {knob.low:g} to {knob.high:g}: {knob.meaning}")
    return "\n".join(lines) + "\n"


def _server(options: argparse.Namespace) -> MockServer:
    parameters = _parameters(options)
    start_ns = time.monotonic_ns() - POWERED_BEFORE_NS
    bench = Bench(parameters, options.seed, start_ns)
    factory = DeviceFactory(bench, start_ns, time.monotonic_ns, options.seed, options.links)
    chosen = [product for role in CHOICES for product in CHOICES[role][vars(options)[role]]]
    spare = [product for role in CHOICES if vars(options)[role] == ALL for product in CHOICES[role][ALL]]
    devices = made((*chosen, *map(INPUTS.named, options.input)), factory, spare)
    return MockServer(bench, devices, time.monotonic_ns)


def _parameters(options: argparse.Namespace) -> Parameters:
    parameters = load_parameters(options.parameters)
    hidden = complete(parameters.hide) | parse_hidden(options.hide)
    tracker = parameters.tracker
    if options.tracker_tcp_port is not None:
        tracker = tracker.model_copy(update={"tcp_port": options.tracker_tcp_port})
    return parameters.model_copy(update={"hide": hidden, "tracker": tracker})


def _be_prompt(priority: int) -> None:
    """Asks for short timer slack and, where wanted, real-time priority; says so where it is not granted."""
    gc.collect()
    gc.freeze()
    shorten_timer_slack()
    if not priority:
        return
    # What the computer puts aside of a bench that rested is read again from a disk others write to: 0.45 s were seen.
    lock_memory()
    cores = os.sched_getaffinity(0)
    # A device has a processor of its own: on the core that the loop takes, the last, a sample waits for a gap of its.
    os.sched_setaffinity(0, cores - {max(cores)} or cores)
    if refused := ask_fifo(priority):
        sys.stderr.write(f"bench: runs without real-time priority {priority} ({refused})\n")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m mock_devices.serve",
        description=(__doc__ or "").partition("\n")[0],
        epilog="example: python -m mock_devices.serve --hide friction.level_N=0.2 --seed 3",
    )
    parser.add_argument("--parameters", type=Path, metavar="FILE", help="TOML file, see mock_devices/default.toml")
    parser.add_argument("--hide", action="append", default=[], metavar="EFFECT[.PARAMETER=VALUE]", help="repeatable")
    parser.add_argument("--list-effects", action="store_true", help="print what --hide takes, and end")
    for role, choices in CHOICES.items():
        parser.add_argument(f"--{role}", choices=tuple(choices), default=ALL)
    parser.add_argument("--input", action="append", default=[], choices=tuple(INPUTS), help="repeatable")
    parser.add_argument("--seed", type=int, default=0, help="of all noise")
    parser.add_argument("--tracker-tcp-port", type=int, metavar="N", help="instead of 8765; 0: any")
    parser.add_argument("--links", type=Path, metavar="FOLDER", help="serial lines there, and again after an unplug")
    parser.add_argument("--priority", type=int, default=0, metavar="N", help="SCHED_FIFO priority to ask for; 0: none")
    parser.add_argument("--with-parent", action="store_true", help="end when standard input is closed")
    return parser


if __name__ == "__main__":
    sys.exit(main())
