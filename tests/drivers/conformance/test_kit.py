"""The conformance kit passes a driver that keeps everything, and names what one of each kind does not keep."""

import os
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from drivers.testing import CHECKS, Nonconformity, UnderTest, checks
from rig.config.products.roles import ForceProduct
from tests.drivers.conformance.made import MadeProduct, MadeSensor, World, nothing_left

Check = Callable[[UnderTest], None]


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    with nothing_left(lambda: set(os.listdir("/proc/self/fd"))):  # noqa: PTH208 - numbers, not paths
        yield


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_a_driver_that_keeps_everything_passes(check: Check) -> None:
    check(World().subject())


PLANTED: tuple[tuple[str, Check, str], ...] = (
    ("nameless", checks.identity, "no serial after start"),
    ("another", checks.identity, "serial='1'.* first and .*serial='2'.* started again"),
    ("slow", checks.rate, "100.0 Hz came where period_ns says 200.0 Hz"),
    ("skips", checks.numbering, r"samples from 41 on are numbered \[42, 44, 46\]... and next_seq"),
    ("clockless", checks.clock, "have the time of the one before: a stream without a clock is dated by its numbers"),
    ("back", checks.clock, "its times run back by 35.000 ms"),
    ("ahead", checks.clock, "-1.0 ms before it arrived"),
    ("millinewton", checks.quantities, "5 N of compression read as 5000 N on fz: wrong unit, channel or sign"),
    ("pounds", checks.quantities, "read as 1.124 N"),
    ("sign", checks.quantities, "read as -5 N"),
    ("invalid", checks.quantities, "none of them valid"),
    ("blocks", checks.waiting, "a poll takes 3.0 ms .limit 1 ms.: it must return at once; .* ThreadedSource"),
    ("deaf", checks.waiting, "its descriptor is not readable within 0.5 s"),
    ("impatient", checks.away, "not polled for 1.5 s, .* it is lost: no answer for 0.5 s"),
    ("dazed", checks.away, "not polled for 1.5 s, .* gives no valid sample"),
    ("breaks", checks.damage, "corrupt on the wire: poll raises IndexError: list index out of range"),
    ("uncounted", checks.damage, "corrupt of a tenth of all messages is in none of its counters"),
    (
        "believes",
        checks.damage,
        r"corrupt on the wire became a sample: \(300000000.0, .*\) N is none of a sensor of 50",
    ),
    ("never lost", checks.lost_and_back, "unplugged for 2 s it still gives samples"),
    ("lost oddly", checks.lost_and_back, "unplugged, poll raises KeyError"),
    ("another", checks.lost_and_back, "before it was unplugged and is"),
    ("skips", checks.lost_and_back, "plugged in again, its samples do not go on with number"),
    ("once", checks.closing, "close raises OSError: closed already"),
    ("leaks", checks.closing, r"close leaves behind 1 \(threads or descriptors\)"),
    ("closed oddly", checks.closing, "closed, poll raises AttributeError instead of DeviceError"),
)


@pytest.mark.parametrize(("defect", "check", "sentence"), PLANTED, ids=[f"{c.__name__}-{d}" for d, c, _ in PLANTED])
def test_each_defect_is_named(defect: str, check: Check, sentence: str) -> None:
    with pytest.raises(Nonconformity, match=sentence):
        check(World(defect).subject())


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
@pytest.mark.parametrize(
    ("member", "named"), [("close", "close"), ("poll", "poll"), ("period_ns", "period_ns"), ("counters", "counters")]
)
def test_a_member_that_is_missing_is_named_by_whichever_check_comes_first(
    check: Check, member: str, named: str
) -> None:
    class Lacking(MadeSensor):
        def __init__(self, world: World) -> None:
            super().__init__(world)
            vars(self).pop(member, None)

    if hasattr(MadeSensor, member):
        setattr(Lacking, member, None)
    subject = replace(World().subject(), open=lambda: Lacking(World()))
    with pytest.raises(Nonconformity, match=f"its driver has no {named}, which ForceSensor has"):
        check(subject)


def test_a_driver_may_know_its_period_and_its_counters_after_its_start_only() -> None:
    class Late(MadeSensor):
        def __init__(self, world: World) -> None:
            super().__init__(world)
            self.later = {name: vars(self).pop(name) for name in ("period_ns", "counters")}

        def start(self) -> None:
            vars(self).update(self.later)
            super().start()

    world = World()
    checks.rate(replace(world.subject(), open=lambda: Late(world)))


def test_a_declaration_that_the_bench_would_refuse_is_refused_here() -> None:
    class Rangeless(ForceProduct):
        driver, advice = MadeProduct.driver, MadeProduct.advice
        product: str = "made"

    for config, said in (
        (Rangeless(), "its declaration cannot be used: Rangeless has no range_N and no range_N_m"),
        ({"rate_Hz": 200}, "its configuration is {'rate_Hz': 200}, where the table of a product is expected"),
    ):
        with pytest.raises(Nonconformity, match=said):
            checks.identity(replace(World().subject(), config=config))  # type: ignore[arg-type]


def test_every_check_has_a_planted_defect() -> None:
    assert {check for _, check, _ in PLANTED} == set(CHECKS)
