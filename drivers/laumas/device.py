"""A load-cell transmitter in the role of force sensor: one question at a time, never waiting for its answer.

It has one channel, Fz. The others are 0 in every sample: forces across the tip and moments are not seen, and neither is
a limit on them kept. It has no clock: a sample is dated by when the transmitter has heard the whole question.
"""

import math
import time
from collections.abc import Callable, Sequence
from functools import partial

from drivers.laumas import codec
from drivers.ports import Port, open_port, read_until
from drivers.roles import Identity, LinkCounters
from rig.channels import ForceSample
from rig.config.products.laumas_tlb import BITS, LaumasWiring
from rig.errors import DeviceError

ANSWER_S, TRIES = 0.3, 3  # the family answers within 5 to 50 ms, as its configured delay says
# Ten periods of 100 Hz: then a question is asked again, the answer was lost.
REPEAT_NS = 100_000_000
# Half a second of them. Questions are counted, not time: it is asked by ``poll``, and while an axis homes nobody polls.
MOST_UNANSWERED = 5
NO_OTHER_CHANNELS = (0.0, 0.0)
NO_MOMENTS = (0.0, 0.0, 0.0)


class LaumasTransmitter:
    """Owns the line from ``start`` to ``close``."""

    def __init__(
        self, open_port: Callable[[], Port], config: LaumasWiring, now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self.counters, self.next_seq = LinkCounters(), 0
        self._open_port, self._config, self._now = open_port, config, now
        self._question = codec.encode_read(config.slave, codec.STATUS, codec.WEIGHTS_COUNT)
        self._heard_after_ns = len(self._question) * BITS * 1_000_000_000 // config.line_baud
        self._latency_ns = round(config.latency_ms * 1e6)
        self._decoder = codec.AnswerDecoder(config.slave, self.counters)
        self.identity, self.period_ns = Identity("", "", ""), round(1e9 / config.rate_Hz)
        self._port: Port | None = None
        self._asked_ns: int | None = None
        self._due_ns = self._unanswered = self._last_capture_ns = 0

    def fileno(self) -> int:
        """Descriptor of the line."""
        return self._started().fileno()

    def start(self) -> None:
        """Identifies the transmitter by its registers; raises DeviceError where it does not answer as one."""
        self.close()
        self._port = self._open_port()
        try:
            about = self._registers(codec.ABOUT, codec.ABOUT_COUNT)
            weights = codec.decode_weights(self._registers(codec.STATUS, codec.WEIGHTS_COUNT))
            self._refuse_errors(weights.status)
        except BaseException:
            self.close()
            raise
        firmware, kind, year, serial, program = about
        settings = {"channels": "fz", "type": str(kind), "year": str(year), "program": str(program)}
        status = {"status at start": f"{weights.status:016b}"}
        self.identity = Identity(self._config.product, str(serial), str(firmware), settings | status)
        self._asked_ns, self._due_ns, self._unanswered = None, 0, 0

    def poll(self, now_ns: int) -> Sequence[ForceSample]:
        """Samples since the last call; raises DeviceError where five questions had no answer, or it refuses."""
        answers = self._decoder.feed(self._started().read())
        samples = [self._sample(answer, now_ns) for answer in answers[-1:] if self._asked_ns is not None]
        self._keep_asking(now_ns)
        return samples

    def close(self) -> None:
        """Gives the line back."""
        if self._port is not None:
            self._port.close()
        self._port = None

    def _refuse_errors(self, status: int) -> None:
        wrong = status & self._config.error_bits
        if wrong:
            raise self._error(
                f"bits {', '.join(str(bit) for bit in range(16) if wrong >> bit & 1)} of its status register 40007 are"
                " set, which count as errors; look at the load cell, or name in force.error_bits those that its manual"
                " calls errors"
            )

    def _started(self) -> Port:
        if self._port is None:
            raise self._error("is not started or was closed; start it first")
        return self._port

    def _keep_asking(self, now_ns: int) -> None:
        if self._asked_ns is not None and now_ns - self._asked_ns > REPEAT_NS:
            self.counters.device_lost += 1
            self._asked_ns, self._unanswered = None, self._unanswered + 1
        if self._unanswered >= MOST_UNANSWERED:
            silent_s = MOST_UNANSWERED * REPEAT_NS / 1e9
            raise self._error(f"no answer for {silent_s:g} s; check its power and the cable")
        if self._asked_ns is None and now_ns >= self._due_ns:
            self._decoder.reset()
            self._started().write(self._question)
            # A host that was interrupted since it looked at its clock asks later than it thinks.
            self._asked_ns = max(now_ns, self._now())
            self._due_ns = max(self._due_ns + self.period_ns, now_ns)

    def _sample(self, answer: codec.RegisterAnswer, now_ns: int) -> ForceSample:
        if answer.exception or len(answer.registers) != codec.WEIGHTS_COUNT:
            raise self._refused(answer, codec.STATUS)
        assert self._asked_ns is not None
        heard_ns = min(self._asked_ns + self._heard_after_ns, now_ns) - self._latency_ns
        self._last_capture_ns = capture_ns = max(heard_ns, self._last_capture_ns + 1)
        self._asked_ns, self._unanswered = None, 0
        weights = codec.decode_weights(answer.registers)
        counts = weights.gross if self._config.weight == "gross" else weights.net
        force_N = counts / self._config.counts_per_N
        valid = not weights.status & self._config.error_bits and abs(force_N) <= self._config.capacity_N
        self.next_seq += 1
        stamps = (self.next_seq - 1, capture_ns, now_ns, 0)
        return ForceSample(*stamps, *NO_OTHER_CHANNELS, force_N, *NO_MOMENTS, math.nan, weights.status, int(valid))

    def _registers(self, address: int, count: int) -> tuple[int, ...]:
        """Registers by a question that is repeated; waits."""
        port = self._started()
        for _ in range(TRIES):
            self._decoder.reset()
            port.write(codec.encode_read(self._config.slave, address, count))
            answers: list[codec.RegisterAnswer] = []
            read_until(port, partial(self._hears, answers), ANSWER_S)
            if answers and (answers[0].exception or len(answers[0].registers) != count):
                raise self._refused(answers[0], address)
            if answers:
                return answers[0].registers
        raise self._error(
            f"no answer of slave {self._config.slave} in {TRIES} tries of {ANSWER_S:g} s; check power, cable,"
            " force.port, force.baud, force.slave, and that the transmitter is set to Modbus RTU without parity"
        )

    def _hears(self, seen: list[codec.RegisterAnswer], data: bytes) -> bool:
        self._decoder.reset()
        seen[:] = self._decoder.feed(data)
        return bool(seen)

    def _refused(self, answer: codec.RegisterAnswer, address: int) -> DeviceError:
        words = codec.EXCEPTIONS.get(answer.exception, f"exception {answer.exception}")
        why = words if answer.exception else f"{len(answer.registers)} registers came"
        return self._error(f"refused register {40001 + address}: {why}; check force.product and force.slave")

    def _error(self, what: str) -> DeviceError:
        return DeviceError(f"{self._config.product} at {self._config.port}: {what}")


def open_sensor(config: LaumasWiring) -> LaumasTransmitter:
    """The transmitter at the configured port, which ``start`` opens."""
    return LaumasTransmitter(partial(open_port, config.port, config.line_baud), config)
