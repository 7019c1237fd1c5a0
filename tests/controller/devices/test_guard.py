"""A plug-in's driver that does anything wrong is lost, named, and takes nothing else along."""

import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import cast

import pytest

from controller.devices import drivers, guard
from controller.devices.guard import (
    AMONG_POLLS,
    BLOCKED_NS,
    BLOCKED_POLLS,
    GuardedAxis,
    GuardedForce,
    GuardedInput,
    GuardedTracker,
)
from controller.devices.states import DeviceState
from controller.inputs.runner import open_input
from controller.loop.modes import Mode
from drivers.roles import Device, Identity, LinkCounters
from mock_devices.testing.clock import Clock
from rig import plugins
from rig.channels import AxisSample, ForceSample, MarkerSample
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.evdev_switch import EvdevSwitch
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.products.ndi_polaris import PolarisWiring
from rig.errors import DeviceError
from rig.input_streams import InputSample
from rig.plugins import Plugin
from tests.controller.fake_bench import FakeBench, wired
from tests.controller.fake_devices import FakeAxis, FakeDevice

PLUGIN = Plugin("tissue_rig.force", "x", "acme-rig", "2.1", "acme-one")
WHO = Identity("acme-one", "7", "1.0")
FORCE = ForceSample(0, 900, 1000, 0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 20.0, 0, 1)
MARKER = MarkerSample(0, 900, 1000, 0, 0, 1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, 0.1, 1)
AXIS = AxisSample(0, 900, 1000, 1.0, 0.0, 0.0, 0, 1)


class Given(FakeDevice):
    """Gives what it is told to, or does it, in the role of sensor, tracker or input."""

    tools = ("tip",)

    def __init__(self, given: Callable[[], Sequence[ForceSample]] | Sequence[object]) -> None:
        super().__init__(Clock(), 1_000_000)
        self.given = given

    def poll(self, now_ns: int) -> Sequence[ForceSample]:
        return self.given() if callable(self.given) else self.given  # type: ignore[return-value] # that is the test

    def concern(self) -> str:
        return ""


def force(given: Callable[[], Sequence[ForceSample]] | Sequence[object]) -> GuardedForce:
    return GuardedForce(PLUGIN, BotaWiring(), lambda: Given(given))


def test_what_is_right_passes_as_it_is() -> None:
    good = [FORCE, FORCE._replace(seq=1, capture_ns=901), FORCE._replace(seq=2, capture_ns=901, fx_N=math.nan, valid=0)]
    assert force(good).poll(1000) == good


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (lambda: dict[str, int]()["counts"], "KeyError: 'counts'"),
        (lambda: sys.exit("dongle"), "SystemExit: dongle"),
        ([MARKER], "it gives MarkerSample.*, where a ForceSample is expected"),
        ([FORCE, FORCE._replace(seq=1, capture_ns=899)], "its times run back by 0.000 ms at sample 1"),
        ([FORCE, FORCE._replace(seq=1, capture_ns=-5_000_000)], "its times run back by 5.001 ms at sample 1"),
        ([FORCE._replace(capture_ns=3_000_000)], "sample 0 was taken 2.999 ms after it came"),
        ([FORCE._replace(fz_N=-981.0)], "981 N from a sensor of 100 N: wrong unit"),
        (lambda: None, "TypeError: 'NoneType' object is not iterable"),
        ([FORCE._replace(fz_N=cast(float, "-1 N"))], "TypeError: must be real number, not str"),
    ],
)
def test_what_is_wrong_is_an_error_that_names_the_plug_in(given: Sequence[object], sentence: str) -> None:
    with pytest.raises(DeviceError, match=f"acme-one, a plug-in of acme-rig 2.1: {sentence}"):
        force(given).poll(1000)


def stream(of: int, tick_ms: int, Hz: int = 1000) -> Iterator[list[ForceSample]]:
    """3000 samples that arrive ``of`` at a time, dated by the tick of ``tick_ms`` before; 0: by arrival."""
    for at in range(0, 3000, of):
        came_ns = 10**9 + at * 10**9 // Hz
        taken_ns = came_ns // (tick_ms * 10**6) * (tick_ms * 10**6) if tick_ms else came_ns
        yield [FORCE._replace(seq=at + k, capture_ns=taken_ns, arrival_ns=came_ns) for k in range(of)]


@pytest.mark.parametrize(
    ("of", "tick_ms", "Hz", "told"),
    [(2, 0, 1000, False), (3, 0, 1000, True), (10, 0, 1000, True), (3, 0, 100, True), (3, 0, 20, True),
     (1, 10, 1000, False)],
    ids=["two", "three", "ten", "three at 100 Hz", "three at 20 Hz", "true but coarse"],
)  # fmt: skip
def test_a_stream_that_is_dated_by_its_arrival_is_told_of_at_the_start_and_never_lost(
    of: int, tick_ms: int, Hz: int, told: bool
) -> None:
    """A true clock of coarse ticks dates nothing by its arrival; half of all may have the time of the one before."""
    given = stream(of, tick_ms, Hz)
    device = Given(lambda: next(given, []))
    guarded = GuardedForce(PLUGIN, BotaWiring(), lambda: device)
    for _ in range(51 // of + 1):
        guarded.poll(0)
    said = "date samples by their numbers (rig.timing.ClockMap), not by arrival" in guarded.counters.trouble
    assert said is told
    at_start = guarded.counters.trouble
    while guarded.poll(0):
        assert guarded.counters.trouble == at_start


def test_a_stream_that_is_bunched_later_is_not_judged_anew() -> None:
    late = FORCE._replace(capture_ns=10**12, arrival_ns=10**12)
    given = iter([*list(stream(1, 0, 1))[:60], [late] * 999])
    guarded = force(lambda: next(given, []))
    while guarded.poll(0):
        assert guarded.counters.trouble == ""


@pytest.mark.usefixtures("declared")
def test_with_a_stream_that_is_dated_by_its_arrival_nothing_starts() -> None:
    bench = FakeBench(wired())
    bench.force.counters.trouble = guard.UNDATED
    bench.until(lambda: bench.loop.connections.statuses["force"].state is DeviceState.DEGRADED, within_s=3.0)
    assert "date samples by their numbers" in bench.loop.connections.refusal()
    assert not bench.latched


def test_keys_that_are_pressed_together_are_no_stream() -> None:
    together = Given([INPUT] * 2000)
    guarded = GuardedInput(PLUGIN, EvdevSwitch(), lambda: together)  # type: ignore[arg-type,return-value]
    guarded.poll(1000)
    assert "date samples" in guarded.concern()
    together.period_ns = 0
    guarded = GuardedInput(PLUGIN, EvdevSwitch(), lambda: together)  # type: ignore[arg-type,return-value]
    guarded.poll(1000)
    assert guarded.concern() == ""


def without(name: str) -> Given:
    """A driver that has no such member, and would be lost by AttributeError in the midst of a trial."""
    made = type("Lacking", (Given,), {name: None} if callable(getattr(Given, name, None)) else {})([])
    if name in vars(made):
        delattr(made, name)
    return made  # type: ignore[no-any-return]


@pytest.mark.parametrize("name", ["close", "poll", "fileno"])
def test_a_driver_that_lacks_a_method_is_refused_when_it_is_made(name: str) -> None:
    lacking = without(name)
    with pytest.raises(DeviceError, match=f"acme-rig 2.1: its driver has no {name}, which ForceSensor has; see"):
        GuardedForce(PLUGIN, BotaWiring(), lambda: lacking)
    assert lacking.closed is (name != "close")


class Late:
    """A tracker that knows nothing of itself before its start, and one thing not even then."""

    closed = False

    def __init__(self, never: str) -> None:
        self.never = never

    def start(self) -> None:
        known = {"counters": LinkCounters(), "next_seq": 0, "identity": WHO, "period_ns": 16_666_667, "tools": ("tip",)}
        vars(self).update({name: one for name, one in known.items() if name != self.never})

    def fileno(self) -> int:
        return 0

    def poll(self, now_ns: int) -> Sequence[MarkerSample]:
        return []

    def close(self) -> None:
        self.closed = True


@pytest.mark.parametrize("never", ["", "counters", "identity", "period_ns", "tools"])
def test_what_a_driver_knows_only_after_its_start_is_demanded_then(never: str) -> None:
    """As `drivers/roles.py` says of its identity."""
    device = Late(never)
    guarded = GuardedTracker(PLUGIN, PolarisWiring(), lambda: device)  # type: ignore[arg-type,return-value]
    if not never:
        guarded.start()
        assert (guarded.identity, guarded.tools) == (WHO, ("tip",))
        return
    with pytest.raises(DeviceError, match=f"acme-rig 2.1: its driver has no {never}, which MarkerTracker has; see"):
        guarded.start()
    assert device.closed


def test_members_are_looked_for_and_not_asked() -> None:
    """Who it is, a driver may know only after its start; one that hands on to another has what that has."""

    class Unstarted(Given):
        identity = property(lambda self: self.never_set)

    class Wrapper:
        def __init__(self) -> None:
            self.inner = Given([])

        def __getattr__(self, name: str) -> object:
            return getattr(self.inner, name)

    for made in (Unstarted([]), Wrapper()):
        GuardedForce(PLUGIN, BotaWiring(), lambda made=made: made)  # type: ignore[misc]


def test_what_a_driver_says_itself_stays() -> None:
    def lost() -> Sequence[ForceSample]:
        raise DeviceError("the line is gone")

    with pytest.raises(DeviceError, match=r"^the line is gone$"):
        force(lost).poll(1000)


def test_wrong_units_of_tracker_and_axis() -> None:
    camera = GuardedTracker(PLUGIN, PolarisWiring(), lambda: Given([MARKER._replace(x_mm=3e6)]))  # type: ignore[arg-type,return-value]
    with pytest.raises(DeviceError, match=r"a marker 3e.06 mm away: wrong unit"):
        camera.poll(1000)
    far = FakeAxis(Clock(), 7)
    far.poll = lambda now_ns: [AXIS._replace(position_mm=2e4)]  # type: ignore[method-assign] # noqa: ARG005 - as named
    axis = GuardedAxis(PLUGIN, Epos4Wiring(), lambda: far)
    with pytest.raises(DeviceError, match="position 20000 mm: wrong unit"):
        axis.poll(1000)


INPUT = InputSample(0, 900, 1000, 0, 0, -1, (1.0, 48.0), 0, 1)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ([INPUT, INPUT._replace(seq=1, capture_ns=899)], "its times run back by 0.000 ms at sample 1"),
        ([INPUT._replace(capture_ns=3_000_000)], "sample 0 was taken 2.999 ms after it came"),
        (lambda: sys.exit("dongle"), "SystemExit: dongle"),
        ([FORCE], "it gives ForceSample.*, where a InputSample is expected"),
        (lambda: None, "TypeError: 'NoneType' object is not iterable"),
    ],
)
@pytest.mark.usefixtures("declared")
def test_an_input_of_a_plug_in_is_guarded_too(
    monkeypatch: pytest.MonkeyPatch, given: Sequence[object], sentence: str
) -> None:
    monkeypatch.setattr(EvdevSwitch, "driver", f"{__name__}:made_input")
    monkeypatch.setattr(f"{__name__}.GIVEN", given)
    device = open_input(EvdevSwitch())
    with pytest.raises(DeviceError, match=f"evdev-switch, a plug-in of acme-rig 2.1: {sentence}"):
        device.poll(1000)


def test_an_input_may_wait_as_it_has_a_thread_of_its_own() -> None:
    def asleep() -> Sequence[object]:
        time.sleep(BLOCKED_NS * 1.1e-9)
        return [INPUT]

    guarded = GuardedInput(PLUGIN, EvdevSwitch(), lambda: Given(asleep))  # type: ignore[arg-type,return-value]
    for _ in range(2 * BLOCKED_POLLS):
        assert guarded.poll(1000) == [INPUT]


def test_tools_of_a_tracker_have_times_of_their_own() -> None:
    frames = [
        MARKER,
        MARKER._replace(seq=1, tool=1),
        MARKER._replace(seq=2, tool=1, capture_ns=950),
        MARKER._replace(seq=3),
    ]
    camera = GuardedTracker(PLUGIN, PolarisWiring(), lambda: Given(frames))  # type: ignore[arg-type,return-value]
    assert camera.poll(1000) == frames


class Waits:
    """A driver whose poll takes ``took_ns``, and whether it waits meanwhile."""

    def __init__(self, took_ns: int, waits: bool) -> None:
        self.now_ns = self.waited = 0
        self.took_ns, self.waits = took_ns, waits

    def guarded(self) -> GuardedForce:
        return GuardedForce(
            PLUGIN, BotaWiring(), lambda: Given(self.poll), now=lambda: self.now_ns, waits=lambda: self.waited,
        )  # fmt: skip

    def poll(self) -> Sequence[ForceSample]:
        self.now_ns += self.took_ns
        self.waited += self.waits
        return []


def test_a_poll_that_waits_is_named_and_one_that_is_interrupted_is_not() -> None:
    blocking = Waits(BLOCKED_NS + 1_000_000, waits=True).guarded()
    for _ in range(BLOCKED_POLLS - 1):
        blocking.poll(0)
    with pytest.raises(DeviceError, match=r"its poll blocks, for 21 ms just now .limit 20 ms.; .* ThreadedSource"):
        blocking.poll(0)
    for good in (Waits(BLOCKED_NS + 1_000_000, waits=False), Waits(BLOCKED_NS, waits=True)):
        guarded = good.guarded()
        for _ in range(AMONG_POLLS):
            guarded.poll(0)


def test_a_real_wait_is_one() -> None:
    def asleep() -> Sequence[ForceSample]:
        time.sleep(BLOCKED_NS * 1.1e-9)
        return []

    guarded = force(asleep)
    with pytest.raises(DeviceError, match="its poll blocks"):
        for _ in range(AMONG_POLLS):
            guarded.poll(0)


def test_it_closes_whatever_the_plug_in_does() -> None:
    class Stubborn(Given):
        def close(self) -> None:
            raise OSError("busy")

    GuardedForce(PLUGIN, BotaWiring(), lambda: Stubborn([])).close()


@pytest.fixture
def declared(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The three usual products as if plug-ins declared them."""
    products = {"input": EvdevSwitch(), "force": BotaWiring(), "axis": Epos4Wiring(), "tracker": PolarisWiring()}
    groups = {
        f"tissue_rig.{role}": (Plugin(f"tissue_rig.{role}", "x", "acme-rig", "2.1", one.product),)
        for role, one in products.items()
    }
    monkeypatch.setattr(plugins, "_met", groups)
    yield


@pytest.mark.usefixtures("declared")
def test_a_driver_that_cannot_even_be_imported_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(BotaWiring, "driver", "acme_sdk_not_here.device:open_sensor")
    with pytest.raises(DeviceError, match=r"bota-sensone, a plug-in of acme-rig 2.1: ModuleNotFoundError: .*acme_sdk"):
        drivers.open_force(BotaWiring())


def test_ours_are_not_wrapped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(BotaWiring, "driver", f"{__name__}:made_device")
    assert isinstance(drivers.open_force(BotaWiring()), FakeDevice)


GIVEN: object = ()


def made_input(_: object) -> Device:
    return Given(GIVEN)  # type: ignore[arg-type]


def made_device(*_: object, **__: object) -> Device:
    return FakeDevice(Clock(), 1_000_000)


@pytest.mark.usefixtures("declared")
def test_a_bench_of_plug_ins_works_and_one_that_raises_stops_it_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """The whole loop on guarded devices, until the sensor's driver raises something of its own."""
    bench = FakeBench(wired())
    wiring, devices = bench.wiring, bench.loop.devices
    bench.loop.devices = drivers.Devices(
        GuardedForce.guard(wiring.force, lambda: devices.force),
        GuardedAxis.guard(wiring.axis, lambda: devices.axis),
        GuardedTracker.guard(wiring.tracker, lambda: devices.tracker) if wiring.tracker and devices.tracker else None,  # type: ignore[arg-type,return-value]
    )
    assert isinstance(bench.loop.devices.force, GuardedForce)
    bench.press(2.0)

    def broken(now_ns: int) -> Sequence[ForceSample]:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(bench.force, "poll", broken)
    bench.until(lambda: bench.latched == "force_lost")
    said = bench.link.of("incident")[-1]["text"]
    assert "force sensor lost: bota-sensone, a plug-in of acme-rig 2.1: ZeroDivisionError: division by zero" in said


@pytest.mark.parametrize("what", ["fault", "enabled", "referenced"])
@pytest.mark.usefixtures("declared")
def test_what_an_axis_raises_between_polls_stops_motion_and_not_the_loop(
    what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = FakeBench(wired())
    axis = GuardedAxis.guard(bench.wiring.axis, lambda: bench.axis)
    bench.loop.devices = replace(bench.loop.devices, axis=axis)
    bench.press(2.0)
    broken = type("Broken", (FakeAxis,), {what: property(lambda _: dict[str, str]()["status"], lambda *_: None)})
    monkeypatch.setattr(bench.axis, "__class__", broken)
    bench.until(lambda: bench.latched in ("drive_fault", "axis_lost"), within_s=1.0)
    assert "maxon-epos4, a plug-in of acme-rig 2.1: KeyError: 'status'" in bench.link.of("incident")[0]["text"]
    bench.until(lambda: bench.mode is Mode.SAFE)
    bench.until(lambda: bool(bench.loop.inputs.axis_lost), within_s=0.1)


def test_an_axis_that_cannot_say_whether_it_is_at_fault_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bench that starts with a drive in fault homes nothing, and waits for recovery."""
    monkeypatch.setattr(guard, "CYCLIC_S", 0.1)
    stuck = FakeAxis(Clock(), 7)
    axis = GuardedAxis(PLUGIN, Epos4Wiring(), lambda: stuck)
    monkeypatch.setattr(FakeAxis, "fault", property(lambda _: time.sleep(60)))
    assert "not done within 0.1 s" in axis.fault
    began_s = time.monotonic()
    assert "not done within 0.1 s" in axis.fault and not axis.enabled and not axis.referenced
    assert time.monotonic() - began_s < 0.1
    with pytest.raises(DeviceError, match=r"a plug-in of acme-rig 2.1: TimeoutError"):
        axis.poll(0)


@pytest.mark.usefixtures("declared")
def test_an_axis_behind_the_guard_is_the_axis_itself() -> None:
    clock = Clock()
    inner = FakeAxis(clock, 1_000_000, position_mm=3.0, target_mm=3.0)
    axis = GuardedAxis.guard(Epos4Wiring(), lambda: inner)
    assert isinstance(axis, GuardedAxis)
    axis.next_seq = 7
    axis.start()
    axis.home()
    axis.enable()
    axis.command(3.5, clock())
    axis.request(clock())
    assert (axis.next_seq, axis.enabled, axis.referenced, axis.fault) == (7, inner.enabled, inner.referenced, "")
    axis.quick_stop()
    axis.power_off()
    axis.reset_fault()
    assert axis.history() == inner.history()
    assert {"home", "enable", "command", "quick_stop", "power_off", "reset_fault"} <= set(inner.calls)


@pytest.mark.parametrize(("period_ns", "said_Hz"), [(10_000_000, "100.0"), (900_000, "1111.1"), (0, "0.0")])
def test_a_rate_that_is_not_the_declared_one_is_refused_at_the_start(period_ns: int, said_Hz: str) -> None:
    """A driver that gives 100 Hz, says so, and is declared as 1000 Hz would be on its own rate for ever after."""
    slow = Given([])
    slow.period_ns = period_ns
    guarded = GuardedForce(PLUGIN, BotaWiring(), lambda: slow)
    with pytest.raises(DeviceError, match=f"its driver has a rate of {said_Hz} Hz, its declaration one of 1000.0 Hz"):
        guarded.start()


def test_a_sensor_is_sold_by_a_round_number_and_an_axis_and_a_switch_answer_what_is_asked() -> None:
    sold = Given([])
    sold.period_ns = 996_094  # 51 samples of its converter's 51.2 kHz, sold as 1000 Hz
    GuardedForce(PLUGIN, BotaWiring(), lambda: sold).start()
    GuardedAxis(PLUGIN, Epos4Wiring(), lambda: FakeAxis(Clock(), 7)).start()
    GuardedInput(PLUGIN, EvdevSwitch(), lambda: Given([])).start()  # type: ignore[arg-type,return-value]


def test_a_start_that_does_not_end_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "START_S", 0.1)
    stuck = Given([])
    monkeypatch.setattr(stuck, "start", lambda: time.sleep(60))
    with pytest.raises(DeviceError, match=r"a plug-in of acme-rig 2.1: TimeoutError: not done within 0.1 s"):
        GuardedForce(PLUGIN, BotaWiring(), lambda: stuck).start()


def test_a_poll_that_never_comes_back_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "CYCLIC_S", 0.1)

    def stuck() -> Sequence[ForceSample]:
        time.sleep(60)
        return []

    with pytest.raises(DeviceError, match=r"a plug-in of acme-rig 2.1: TimeoutError: not done within 0.1 s"):
        force(stuck).poll(0)


@pytest.mark.parametrize("what", ["command", "request", "quick_stop", "power_off"])
def test_an_axis_that_never_comes_back_is_named_too(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "CYCLIC_S", 0.1)
    stuck = FakeAxis(Clock(), 7)
    monkeypatch.setattr(stuck, what, lambda *_: time.sleep(60))
    axis = GuardedAxis(PLUGIN, Epos4Wiring(), lambda: stuck)
    asked = {"command": (1.0, 0), "request": (0,)}.get(what, ())
    with pytest.raises(DeviceError, match=r"not done within 0\.1 s"):
        getattr(axis, what)(*asked)
