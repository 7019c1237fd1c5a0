"""What every driver keeps, one function each. What a loop takes for granted is looked for here first."""

import itertools
import math
import statistics
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from drivers.roles import LinkCounters
from drivers.testing.under_test import FEW_S, AnyDevice, AnySample, Nonconformity, UnderTest
from rig.channels import ForceSample, MarkerSample
from rig.config.products.input_role import InputProduct
from rig.config.products.roles import AxisProduct, ForceProduct
from rig.errors import DeviceError
from rig.input_streams import InputSample

# 60 frames of a tracker: a rate is then known to two percent.
LISTEN_S = 1.0
# As `rig doctor` judges: half of what lies between neighbouring rates of a sensor.
RATE_TOLERANCE = 0.1
# A loop has a millisecond for everything; a busy computer takes more now and then, which a median does not see.
POLL_NS = 1_000_000
# Samples that a driver numbers go on from here where it takes over from another.
NEXT_SEQ = 41
# A weight that every sensor of a bench for limbs sees, and how far it may be read wrong before it is calibrated: a gain
# that a data sheet allows is 5 %, a wrong unit is a factor of four (pounds) at least.
LOAD_N, LOAD_TOLERANCE = 5.0, 0.25
# A tenth of all messages.
DAMAGE_SHARE = 0.1
# An axis homes over its travel for seconds, in which nobody polls; more than any driver waits for a silent device.
AWAY_S = 1.5
# `SILENT_NS` of the loop, and once more: a device that is gone is known to be by then.
LOST_S = 2.0
# Beyond it a place is no place on a bench: the largest volume of a camera.
FARTHEST_MM = 10_000.0
# Two captures of one sensor lie a period apart on the average; those that come together may be dated closer.
LEAST_STEP = 0.02


def identity(subject: UnderTest) -> None:
    """A driver says who the device is once it has started, and a second one the same."""
    found = []
    for _ in range(2):
        with subject.started() as device:
            found.append(device.identity)
    # Not every board with a switch or a sensor on it has a number.
    for what in ("product",) if isinstance(subject.config, InputProduct) else ("product", "serial"):
        if not getattr(found[0], what):
            raise Nonconformity(f"its identity has no {what} after start")
    if (found[0].product, found[0].serial) != (found[1].product, found[1].serial):
        raise Nonconformity(f"it calls itself {found[0]} first and {found[1]} when it is started again")


def rate(subject: UnderTest) -> None:
    """Samples come as often as the driver and its declaration say."""
    with subject.started() as device:
        samples = subject.listen(device, LISTEN_S).samples
        period_ns = device.period_ns
    captures = sorted({sample.capture_ns for sample in samples})
    if len(captures) < 3:
        raise Nonconformity(f"{len(samples)} samples with {len(captures)} times of capture came in {LISTEN_S:g} s")
    seen_Hz = (len(captures) - 1) / ((captures[-1] - captures[0]) * 1e-9)
    promised_Hz = subject.sampled_Hz
    if promised_Hz is None:
        return
    for what, said_Hz in (("period_ns", 1e9 / (period_ns or math.inf)), ("its declaration", promised_Hz)):
        if abs(seen_Hz - said_Hz) > RATE_TOLERANCE * said_Hz:
            raise Nonconformity(f"{seen_Hz:.1f} Hz came where {what} says {said_Hz:.1f} Hz")


def numbering(subject: UnderTest) -> None:
    """Samples are numbered one after another, from the number that the driver was given."""
    with subject.started(NEXT_SEQ) as device:
        seqs = [sample.seq for sample in subject.listen(device, FEW_S).samples]
        next_seq = device.next_seq
    if not seqs or seqs != list(range(NEXT_SEQ, next_seq)):
        raise Nonconformity(f"samples from {NEXT_SEQ} on are numbered {seqs[:3]}... and next_seq is then {next_seq}")


def clock(subject: UnderTest) -> None:
    """Captures go on upwards, each of its own, and none is later than its arrival."""
    with subject.started() as device:
        samples = subject.listen(device, LISTEN_S).samples
        end_ns, period_ns = subject.now(), device.period_ns
    for sample in samples:
        if not 0 < sample.capture_ns <= sample.arrival_ns <= end_ns:
            raise Nonconformity(
                f"sample {sample.seq} was captured {(sample.arrival_ns - sample.capture_ns) * 1e-6:.1f} ms before it"
                f" arrived, {(end_ns - sample.arrival_ns) * 1e-6:.1f} ms before it was asked for: on which clock?"
            )
    _in_order(_one_stream(samples), period_ns)


def _one_stream(samples: Sequence[AnySample]) -> list[AnySample]:
    """Those of one tool where there are several."""
    first = samples[0].tool if samples and isinstance(samples[0], MarkerSample) else None
    return [sample for sample in samples if not isinstance(sample, MarkerSample) or sample.tool == first]


def _in_order(samples: Sequence[AnySample], period_ns: int) -> None:
    steps_ns = [after.capture_ns - before.capture_ns for before, after in itertools.pairwise(samples)]
    back_ns = min(steps_ns, default=0)
    if back_ns < 0:
        raise Nonconformity(f"its times run back by {-back_ns * 1e-6:.3f} ms")
    alike = sum(step_ns < LEAST_STEP * period_ns for step_ns in steps_ns)
    if alike > RATE_TOLERANCE * len(steps_ns):
        raise Nonconformity(
            f"{alike} of {len(samples)} samples have the time of the one before: a stream without a clock is dated by"
            " its numbers and the period, with `rig.timing.ClockMap`"
        )


def quantities(subject: UnderTest) -> None:
    """Values are finite where they are valid, in the range of the product, and in its unit: newton, millimetre."""
    with subject.started() as device:
        unloaded = subject.listen(device, FEW_S).samples
        _possible(unloaded, subject)
        if subject.load is None or not isinstance(subject.config, ForceProduct):
            return
        subject.load(LOAD_N)
        try:
            subject.listen(device, FEW_S)
            loaded = subject.listen(device, FEW_S).samples
        finally:
            subject.load(0.0)
    _weighed(unloaded, loaded, subject.config)


def _possible(samples: Sequence[AnySample], subject: UnderTest) -> None:
    valid = [sample for sample in samples if sample.valid]
    if not valid:
        raise Nonconformity(f"{len(samples)} samples came in {FEW_S:g} s, none of them valid")
    for sample in valid:
        wrong = _impossible(sample, subject)
        if wrong:
            raise Nonconformity(f"sample {sample.seq} is marked valid, and {wrong}")


def _impossible(sample: AnySample, subject: UnderTest) -> str:
    if isinstance(sample, ForceSample):
        range_N = subject.config.range_N if isinstance(subject.config, ForceProduct) else math.inf
        known = [value for value in sample[4:7] if not math.isnan(value)]
        fits = bool(known) and all(abs(value) <= range_N for value in known)
        return "" if fits else f"{sample[4:7]} N is none of a sensor of {range_N:g} N"
    if isinstance(sample, MarkerSample):
        length = math.hypot(sample.q0, sample.qx, sample.qy, sample.qz)
        place_mm = math.hypot(sample.x_mm, sample.y_mm, sample.z_mm)
        fits = abs(length - 1.0) < 1e-3 and place_mm <= FARTHEST_MM
        return "" if fits else f"it is {place_mm:.3g} mm away with a quaternion of length {length:.3g}"
    if isinstance(sample, InputSample):
        count = len(subject.config.channels) if isinstance(subject.config, InputProduct) else 0
        fits = len(sample.values) == count and all(map(math.isfinite, sample.values))
        return "" if fits else f"{sample.values} are no values of {count} channels"
    return "" if abs(sample.position_mm) <= FARTHEST_MM else f"its position is {sample.position_mm:g} mm"


def _weighed(unloaded: Sequence[AnySample], loaded: Sequence[AnySample], config: ForceProduct) -> None:
    channel = ("fx", "fy", "fz").index(config.axis)
    sign = 1.0 if config.compression == "positive" else -1.0
    before_N, after_N = (
        statistics.fmean(s[4:7][channel] for s in side if isinstance(s, ForceSample) and s.valid)
        for side in (unloaded, loaded)
    )
    read_N = sign * (after_N - before_N)
    if abs(read_N - LOAD_N) > LOAD_TOLERANCE * LOAD_N:
        raise Nonconformity(
            f"{LOAD_N:g} N of compression read as {read_N:.4g} N on {config.axis}: wrong unit, channel or sign?"
        )


def waiting(subject: UnderTest) -> None:
    """The descriptor turns readable, and a poll never waits for what has not come."""
    with subject.started() as device:
        device.poll(subject.now())  # some devices are asked, and answer
        if subject.sampled_Hz is not None and not subject.wait(device, FEW_S):
            raise Nonconformity(f"its descriptor is not readable within {FEW_S:g} s, while samples come")
        polls_ns = subject.listen(device, FEW_S).polls_ns
    longest_ns = statistics.median(polls_ns)
    if longest_ns > POLL_NS:
        raise Nonconformity(
            f"a poll takes {longest_ns * 1e-6:.1f} ms (limit {POLL_NS * 1e-6:g} ms): it must return at once;"
            " what blocks belongs into a ThreadedSource"
        )


def away(subject: UnderTest) -> None:
    """Nobody polls while an axis homes: that is no silence of the device, which gives samples afterwards as before."""
    if isinstance(subject.config, AxisProduct):
        return  # it is what is waited for meanwhile
    with subject.started() as device:
        subject.sleep(AWAY_S)
        try:
            samples = subject.listen(device, FEW_S).samples
        except DeviceError as error:
            raise Nonconformity(f"not polled for {AWAY_S:g} s, as while an axis homes, it is lost: {error}") from error
        if not samples or not samples[-1].valid:
            raise Nonconformity(f"not polled for {AWAY_S:g} s, as while an axis homes, it gives no valid sample")


def damage(subject: UnderTest) -> None:
    """What a wire spoils is dropped and counted, and never becomes a sample; afterwards all is as before."""
    for kind in subject.damage:
        with subject.started() as device:
            before = _losses(device.counters)
            with subject.failing(kind, DAMAGE_SHARE):
                said_lost = _stands(subject, device, kind)
            if not said_lost and _losses(device.counters) == before:
                raise Nonconformity(f"{kind} of a tenth of all messages is in none of its counters")
        with subject.started() as device:
            _possible(subject.listen(device, FEW_S).samples, subject)


def _losses(counters: LinkCounters) -> int:
    return counters.checksum_errors + counters.discarded_bytes + counters.device_lost + counters.repeated


def _stands(subject: UnderTest, device: AnyDevice, kind: str) -> bool:
    """Whether it said that it was lost, which is an answer too."""
    try:
        samples = subject.listen(device, LISTEN_S).samples
    except DeviceError:
        return True
    except Exception as error:
        raise Nonconformity(f"{kind} on the wire: poll raises {type(error).__name__}: {error}") from error
    for sample in samples:
        if sample.valid and _impossible(sample, subject):
            raise Nonconformity(f"{kind} on the wire became a sample: {_impossible(sample, subject)}")
    return False


def lost_and_back(subject: UnderTest) -> None:
    """A cable that is pulled ends the samples; a new driver goes on once it is plugged in again."""
    if not subject.unplugs:
        return
    with subject.started() as device:
        first = device.identity
        subject.listen(device, FEW_S)
        with subject.failing("unplug", True):
            _ends(subject, device)
            next_seq = device.next_seq
            device.close()
    again = subject.restarted(next_seq)
    try:
        samples = subject.listen(again, FEW_S).samples
        if (again.identity.product, again.identity.serial) != (first.product, first.serial):
            raise Nonconformity(f"it was {first} before it was unplugged and is {again.identity} now")
        if not samples or samples[0].seq != next_seq:
            raise Nonconformity(f"plugged in again, its samples do not go on with number {next_seq}")
    finally:
        again.close()


def _ends(subject: UnderTest, device: AnyDevice) -> None:
    """Raises DeviceError, or falls silent: a link without a connection cannot know more."""
    try:
        subject.listen(device, LOST_S)
        left = subject.listen(device, FEW_S).samples
    except DeviceError:
        return
    except Exception as error:
        raise Nonconformity(f"unplugged, poll raises {type(error).__name__}: {error}") from error
    if left:
        raise Nonconformity(f"unplugged for {LOST_S:g} s it still gives samples: {len(left)} in {FEW_S:g} s")


def closing(subject: UnderTest) -> None:
    """Closing may be done twice, leaves neither thread nor descriptor behind, and nothing can be polled after it."""
    descriptors, threads = _descriptors(), set(threading.enumerate())
    device = subject.made()
    subject.start(device)
    subject.listen(device, FEW_S)
    for _ in range(2):
        _silently(device.close)
    left = [thread.name for thread in set(threading.enumerate()) - threads if thread.is_alive()]
    if left or _descriptors() > descriptors:
        raise Nonconformity(f"close leaves behind {left or _descriptors() - descriptors} (threads or descriptors)")
    try:
        samples = device.poll(subject.now())
    except DeviceError:
        return
    except Exception as error:
        raise Nonconformity(f"closed, poll raises {type(error).__name__} instead of DeviceError: {error}") from error
    if samples:
        raise Nonconformity("closed, it still gives samples")


def _silently(close: Callable[[], None]) -> None:
    try:
        close()
    except Exception as error:
        raise Nonconformity(f"close raises {type(error).__name__}: {error}") from error


def _descriptors() -> int:
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


CHECKS: tuple[Callable[[UnderTest], None], ...] = (
    identity, rate, numbering, clock, quantities, waiting, away, damage, lost_and_back, closing,
)  # fmt: skip
