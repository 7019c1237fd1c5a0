"""One input: opened, listened to, and opened again when it is lost; a thread of its own, since drivers may wait."""

import contextlib
import select
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pkgutil import resolve_name

from controller.devices import states
from controller.devices.connections import of_stream
from controller.devices.guard import GuardedInput
from controller.devices.health import StreamHealth
from controller.devices.states import DeviceState, DeviceStatus, Observation
from drivers.input_role import Input
from rig.channels import Stream
from rig.config.products.input_role import InputProduct
from rig.errors import DeviceError, RigError

# A plug that is pushed in bounces, and a board that restarts takes two seconds.
FIRST_WAIT_S, LONGEST_WAIT_S = 1.0, 4.0
# How long a quiet input is waited for; nothing depends on it but how soon a lost one is noticed.
LISTEN_S = 0.05
LEAVE_S = 4.0  # longer than any driver waits in `close`
# Twenty turns; with two words of this process a needed input that hangs is then lost within the 1.3 s that it has.
TURN_NS = 1_000_000_000
# Half as long again as the longest start of ours, a stream that is looked for, opened and its clock waited for.
OPEN_NS = 15_000_000_000
HANGS = "its driver does not come back; look at the device, then start again"
Put = Callable[[int, bytes], None]


def open_input(config: InputProduct) -> Input:
    """The input, not yet started; raises DeviceError where its port cannot be opened."""
    return GuardedInput.guard(config, lambda: resolve_name(config.driver)(config))


class InputRunner:
    """Owns one input from ``begin`` to ``close``; ``put`` takes the rows of its stream."""

    def __init__(
        self,
        config: InputProduct,
        stream: Stream,
        put: Put,
        opens: Callable[[InputProduct], Input] = open_input,
        now: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._config, self._stream, self._put, self._opens, self._now = config, stream, put, opens, now
        self._status, self._due_ns = states.connecting(now()), now() + OPEN_NS
        self._next_seq = 0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name=stream.name, daemon=True)

    @property
    def status(self) -> DeviceStatus:
        """As it is now: one whose driver has not come back in time is lost, whatever it was before."""
        was, now_ns = self._status, self._now()
        hangs = now_ns > self._due_ns and was.state is not DeviceState.LOST
        return states.following(was, Observation(None, lost=HANGS), now_ns) if hangs else was

    def begin(self) -> None:
        """Starts its thread."""
        self._thread.start()

    def close(self) -> None:
        """Closes the device, within a deadline."""
        self._ending.set()
        self._thread.join(LEAVE_S)

    def _run(self) -> None:
        wait_s = FIRST_WAIT_S
        while not self._ending.is_set():
            self._due_ns = self._now() + OPEN_NS
            try:
                with contextlib.closing(self._opens(self._config)) as device:
                    device.next_seq = self._next_seq
                    device.start()
                    wait_s = FIRST_WAIT_S
                    self._listen(device)
            except RigError as error:
                self._note(Observation(None, lost=str(error)))
            except BaseException as error:  # a plug-in may even exit: named, and tried again like one unplugged
                self._note(Observation(None, lost=f"its driver failed: {type(error).__name__}: {error}"))
            self._ending.wait(wait_s)
            wait_s = min(2 * wait_s, LONGEST_WAIT_S)

    def _listen(self, device: Input) -> None:
        health = StreamHealth(device.period_ns or 1, states.SILENT_NS)
        begun_ns = self._now()
        while not self._ending.is_set():
            self._due_ns = self._now() + TURN_NS
            select.select([device.fileno()], [], [], LISTEN_S)
            for sample in device.poll(self._now()):
                self._put(self._stream.id, self._stream.pack(sample.row))
                self._next_seq = sample.seq + 1
                health.update(sample.capture_ns, bool(sample.valid))
            seen = self._observed(device, health)
            self._note(seen)
            self._refuse_silence(seen, begun_ns)

    def _observed(self, device: Input, health: StreamHealth) -> Observation:
        """One that has no rate is as young as its open port."""
        seen = of_stream(health, "", self._now()) if device.period_ns else Observation(0)
        return replace(seen, imperfect=device.concern() or seen.imperfect)

    def _refuse_silence(self, seen: Observation, begun_ns: int) -> None:
        """A port that stays open over a device that says nothing is opened again."""
        silent_ns = self._now() - begun_ns if seen.age_ns is None else seen.age_ns
        if silent_ns > states.CONNECTING_NS:
            raise DeviceError(f"no sample for {silent_ns * 1e-9:.0f} s; look at {self._config.advice}")

    def _note(self, seen: Observation) -> None:
        """A lost one stays so, with what it was lost by, until a sample comes."""
        if seen.lost or seen.age_ns is not None or self._status.state is not DeviceState.LOST:
            self._status = states.following(self._status, seen, self._now())
