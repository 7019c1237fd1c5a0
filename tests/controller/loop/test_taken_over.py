"""Whoever started a program is relieved of control at any moment of it: the tip comes out, and the stop has a name.

The supervisor says four times in a lease that nobody attends, in whichever cycle that falls.
"""

import copy

import pytest

from controller.loop.modes import AT_REST, Mode
from controller.loop.steps import Hold
from tests.controller.fake_bench import APPROACH, LEAVE, PRESS, ZERO, FakeBench

# From the zero to the way out, 4.2 s; no two of them at the same place of a step.
MOMENTS_S = [0.013 + 0.347 * number for number in range(12)]
# A quarter of the lease of 3 s.
TOLD_CYCLES = 750


@pytest.fixture(scope="module")
def moments() -> list[FakeBench]:
    """The bench at each moment of a program."""
    bench, found = FakeBench(), list[FakeBench]()
    bench.begin(ZERO, APPROACH, PRESS, Hold(duration_s=0.5), LEAVE)
    for moment_s in MOMENTS_S:
        bench.wait(moment_s - bench.time_s)
        found.append(copy.deepcopy(bench))
        found[-1].keep_lease = False  # it hears nothing but what the test says
    modes = {one.mode for one in found}
    assert modes >= {Mode.FREE, Mode.APPROACH, Mode.COMPRESS, Mode.RETRACT}, modes
    return found


def told_until_at_rest(bench: FakeBench) -> None:
    while bench.loop.machine.busy:
        bench.say("unattended")
        bench.cycles(TOLD_CYCLES)
    assert bench.mode in AT_REST


@pytest.mark.parametrize("number", range(len(MOMENTS_S)))
def test_the_tip_comes_out_and_the_stop_has_a_name(moments: list[FakeBench], number: int) -> None:
    bench = moments[number]
    began = bench.loop.machine.busy
    told_until_at_rest(bench)
    assert bench.force.true_N == 0.0
    assert bench.latched == ("operator_silent" if began else "")
    assert [said["outcome"] for said in bench.link.of("finished")] == (["operator_silent"] if began else ["complete"])


def test_a_program_that_begins_just_after_it_was_told_ends_with_the_next_time() -> None:
    bench = FakeBench()
    bench.keep_lease = False
    bench.say("unattended")
    bench.begin(ZERO, APPROACH, PRESS, Hold(duration_s=30.0), LEAVE)
    told_until_at_rest(bench)
    assert (bench.latched, bench.force.true_N) == ("operator_silent", 0.0)
    assert bench.time_s < 3.0
