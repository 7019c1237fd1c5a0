"""The loop's own process: ``python -m controller.loop.process WIRING_JSON RING_PATH SOCKET_FD STOP_PATH [HELD]``.

It owns the devices, says ``ready`` with their identities (or ``failed`` with one sentence), then runs until it is told
to leave or left alone. Whatever happens, the devices are closed, which stops the axis. With HELD, a sentence that says
why, or with a drive in fault, it moves nothing and waits for recovery.
"""

import contextlib
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from controller.devices.absent import start_what_answers
from controller.devices.drivers import Devices, Interruption, openers, start_devices
from controller.inputs.commands import with_inputs
from controller.loop import realtime
from controller.loop.bench_loop import BenchLoop
from controller.loop.commands import Inbox
from controller.loop.executive import AHEAD, Executive, sleep_then_spin
from controller.loop.messages import TO_LOOP, DeviceFound, LoopFailed, Ready
from controller.loop.touch import warm_up
from controller.safety.table import TABLE, Check
from controller.stop.start import StartGuard
from controller.stop.word import Responder, StopWord
from drivers.roles import Device, ServoAxis
from rig.channel import Channel
from rig.config.wiring import Wiring
from rig.errors import RigError, SafetyStop
from rig.recording.ring import RingWriter


def main(arguments: list[str], table: tuple[Check, ...] = TABLE) -> int:
    """Runs the loop; 0 after an orderly end, 1 after a failure that was reported over the channel.

    ``table`` is what it stops for; nothing but a trial of the safety table itself gives another one.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    wiring = Wiring.model_validate_json(arguments[0])
    channel = Channel(socket.socket(fileno=int(arguments[2])), TO_LOOP)
    try:
        with contextlib.closing(StopWord.open(Path(arguments[3]))) as page:
            _serve(wiring, Path(arguments[1]), channel, Responder(page), table, "".join(arguments[4:5]))
    except RigError as error:
        channel.send(LoopFailed(text=str(error), stopped=isinstance(error, SafetyStop)))
        return 1
    except Exception as error:  # the last word of a dying process: named, sent, and the devices are closed by then
        channel.send(LoopFailed(text=f"the loop met an error of its own: {type(error).__name__}: {error}"))
        raise
    finally:
        channel.close()
    return 0


def _serve(
    wiring: Wiring, ring_path: Path, channel: Channel, stops: Responder, table: tuple[Check, ...], held: str
) -> None:
    # Memory and privileges first: from the axis' start on, the drive counts the time between our heartbeats.
    ring = RingWriter.create(ring_path)
    stops.attach(os.getpid())
    try:
        warm_up(wiring.tip.round)
        granted = realtime.acquire(wiring.loop.priority)
        interruption, ending = Interruption(), threading.Event()
        _when_ended(ending.set)
        start = start_what_answers if held else start_devices
        with contextlib.ExitStack() as started:
            with StartGuard(stops) as guard:
                interruption.source = lambda: ending.is_set() or guard.interrupted()
                devices = start(wiring, interruption)
                started.callback(devices.close)
                with guard.moving():
                    held = _prepare(devices.axis, held)
            inbox = Inbox(channel, stops, interruption)
            _when_ended(inbox.end)
            if ending.is_set():
                inbox.end()
            _run(wiring, devices, ring, channel, inbox, granted, table, held)
    finally:
        ring.close()


def _when_ended(do: Callable[[], object]) -> None:
    """A computer that shuts down, or a terminal that is closed, leaves the axis braked and the tip outside."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: do())


def _prepare(axis: ServoAxis, held: str) -> str:
    """Homes and enables the axis; not where a person is to look first, and then returns why."""
    if axis.fault and not held:
        held = f"the drive was in fault when the bench started: {axis.fault}"
    if not held:
        axis.home()
        axis.enable()
    return held


def _found(device: Device) -> DeviceFound:
    who = device.identity
    settings = {**who.settings, "period_ns": str(device.period_ns)}
    return DeviceFound(product=who.product, serial=who.serial, firmware=who.firmware, settings=settings)


def _run(
    wiring: Wiring,
    devices: Devices,
    ring: RingWriter,
    channel: Channel,
    inbox: Inbox,
    granted: dict[str, str],
    table: tuple[Check, ...],
    held: str,
) -> None:
    found = {role: _found(device) for role, device in devices.by_role().items()}
    channel.send(Ready(devices=found, realtime=granted))
    opens = openers(wiring, inbox.interruption)
    commands = with_inputs(inbox, wiring, ring, ring.path, time.monotonic_ns())
    loop = BenchLoop(wiring, devices, ring, channel, commands, time.monotonic_ns, table, opens, held)
    spin_ns = min(realtime.spin_ns(granted), round(AHEAD * loop.phase.period_ns))
    try:
        Executive(sleep=sleep_then_spin(spin_ns)).run(loop, loop.phase)
    finally:
        loop.close()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
