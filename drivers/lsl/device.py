"""A stream by Lab Streaming Layer in the role of input."""

import math
import time
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

from drivers.lsl.clock import SenderClock
from drivers.lsl.library import RESOLVE_S, ClockCorrection, correction, load
from drivers.lsl.puller import Pulled, Puller
from drivers.roles import Identity, LinkCounters
from drivers.threaded_source import ThreadedSource
from rig.config.products.lsl_stream import LslStream
from rig.errors import DeviceError
from rig.input_streams import InputSample

# Five exchanges of the first estimate take half a second.
CORRECT_S = 3.0
RATE_TOLERANCE = 0.1  # senders state the rate they were asked for, and crystals are better than that
# Ten seconds at 1 kHz: whoever takes none for so long has lost them, which is counted.
MOST = 10_000
BUFFER_S = 10  # of samples that wait in the library while this process is held up


class LslInlet:
    """Owns the inlet from ``start`` to ``close``; ``ask`` says what the library knows of the sender's clock."""

    def __init__(
        self, config: LslStream, ask: Callable[[ModuleType, Any, float], ClockCorrection] = correction
    ) -> None:
        self.counters, self.next_seq = LinkCounters(), 0
        self.identity = Identity(config.product, "", "")
        self.period_ns = round(1e9 / config.rate_Hz) if config.rate_Hz else 0
        self._config, self._ask = config, ask
        self._source: ThreadedSource[Pulled | ClockCorrection] | None = None
        self._heard_ns = 0

    def start(self) -> None:
        """Finds the stream, holds it against the table, and waits for its clock."""
        pylsl = load(self._config.scope)
        info = self._found(pylsl)
        self._refuse(pylsl, info)
        recover = bool(self._config.source_id) and self.period_ns > 0
        inlet = pylsl.StreamInlet(info, max_buflen=BUFFER_S, recover=recover)
        try:
            inlet.open_stream(timeout=CORRECT_S)
            self._refuse_units(inlet.info(timeout=CORRECT_S))
            first = self._ask(pylsl, inlet, CORRECT_S)
        except RuntimeError as error:
            raise DeviceError(f"{self._name}: the stream does not answer: {error}; start its program again") from error
        host_ns = time.monotonic_ns() - round(pylsl.local_clock() * 1e9)
        self._clock = SenderClock(self.counters, host_ns)
        self._clock.correct(first)
        about = {"host": info.hostname(), "source_id": info.source_id(), "type": info.type()}
        self.identity = Identity(self._config.product, info.source_id(), f"protocol {info.version()}", about)
        self._heard_ns = time.monotonic_ns()
        self._source = ThreadedSource(self._name, Puller(pylsl, inlet, self._ask).read, MOST)
        self._source.start()

    @property
    def _name(self) -> str:
        return f"stream {self._config.port!r}"

    def _found(self, pylsl: ModuleType) -> Any:
        infos = {info.uid(): info for info in pylsl.resolve_byprop("name", self._config.port, 2, RESOLVE_S)}
        wanted = [info for info in infos.values() if self._config.source_id in ("", info.source_id())]
        if len(wanted) == 1:
            return wanted[0]
        there = ", ".join(sorted(f"{info.source_id()!r} on {info.hostname()}" for info in infos.values()))
        if wanted:
            raise DeviceError(f"{self._name}: {len(wanted)} have that name ({there}); give one by its source_id")
        others = f"; of that name there are {there}" if there else ""
        scope = self._config.scope
        raise DeviceError(f"{self._name}: is not there (scope {scope}){others}; start its program, or correct the name")

    def _refuse(self, pylsl: ModuleType, info: Any) -> None:
        """What does not fit the table."""
        count, wanted, rate_Hz = info.channel_count(), len(self._config.units), info.nominal_srate()
        if info.channel_format() == pylsl.cf_string:
            raise DeviceError(f"{self._name}: carries text; an input takes numbers")
        if count != wanted:
            raise DeviceError(f"{self._name}: has {count} channels, units names {wanted}; name each of them")
        if abs(rate_Hz - self._config.rate_Hz) > RATE_TOLERANCE * max(rate_Hz, self._config.rate_Hz):
            said = f"{rate_Hz:g} Hz" if rate_Hz else "no rate (0)"
            raise DeviceError(f"{self._name}: states {said}, rate_Hz says {self._config.rate_Hz:g}; correct it")

    def _refuse_units(self, info: Any) -> None:
        """Units that the sender states must be those of the table; many state none."""
        stated = info.get_channel_units() or []
        for (name, unit), theirs in zip(self._config.units.items(), stated, strict=False):
            if theirs and theirs != unit:
                raise DeviceError(f"{self._name}: gives {name} in {theirs!r}, units says {unit!r}; correct it")

    def fileno(self) -> int:
        """Descriptor that turns readable when a sample may have come."""
        return self._running.fileno()

    @property
    def _running(self) -> ThreadedSource[Pulled | ClockCorrection]:
        if self._source is None:
            raise DeviceError(f"{self._name}: is not open; start it first")
        return self._source

    def poll(self, now_ns: int) -> Sequence[InputSample]:
        """Samples since the last call; raises DeviceError where there were none for too long."""
        found: list[InputSample] = []
        for item, arrival_ns in self._running.take():
            if isinstance(item, ClockCorrection):
                self._clock.correct(item)
            else:
                found += self._samples(item, arrival_ns)
        if found:
            self._heard_ns = now_ns
        silent_s = (now_ns - self._heard_ns) * 1e-9
        if self.period_ns and silent_s > self._config.silent_s:
            raise DeviceError(
                f"{self._name}: no sample for {silent_s:.1f} s (silent_s {self._config.silent_s:g}); "
                "look after its program"
            )
        self.counters.device_lost = self._running.dropped
        return found

    def _samples(self, item: Pulled, arrival_ns: int) -> list[InputSample]:
        stamps = self._clock.stamps(item.stamp_s, arrival_ns)
        if stamps is None:
            return []
        seq, self.next_seq = self.next_seq, self.next_seq + 1
        self.counters.frames += 1
        valid = all(map(math.isfinite, item.values))
        clock = (stamps.device_ns, stamps.correction_ns, stamps.uncertainty_ns)
        return [InputSample(seq, stamps.capture_ns, arrival_ns, *clock, item.values, 0, int(valid))]

    def concern(self) -> str:
        """A sender without a clock that is known."""
        if not self._clock.foreign:
            return ""
        return (
            f"{self._clock.foreign} samples carry no time of the LSL clock; when they were taken nobody knows:"
            " capture is arrival there"
        )

    def close(self) -> None:
        """Lets go of the stream."""
        source, self._source = self._source, None
        if source:
            source.close()


def open_stream(config: LslStream) -> LslInlet:
    """The stream by its name, not yet looked for."""
    return LslInlet(config)
