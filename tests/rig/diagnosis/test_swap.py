"""Swaps put a wrong beginning right as far as they go, and what is named is what the final model holds."""

from benchmarks.hidden.draw import Secret, recorded, session_of
from rig.diagnosis.effects.bench import BACKLASH, FRICTION, SENSOR_HYSTERESIS, TIME_OFFSET, TIP_INERTIA, ZERO_DRIFT
from rig.diagnosis.fit import first_fit, fit, refreshed
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.observations import observe
from rig.diagnosis.search import shared_variables, swap


def test_every_cause_named_after_two_swaps_is_in_the_model() -> None:
    hidden = {"friction": {"newton": 0.2, "mm": 0.1}, "time_offset": {"s": 0.01}}
    bench, made = recorded(812, Secret("both", hidden, {}), 4)
    problem = IndentationProblem(observe(session_of(bench, made)), "index")
    wrong = (ZERO_DRIFT, TIP_INERTIA)
    start = {par.name: par.null + par.scale for effect in wrong for par in effect.pars}
    model = refreshed(fit(problem, wrong, {**first_fit(problem).values, **start}))
    named, final = swap(model, [FRICTION, TIME_OFFSET], {})
    assert {one.effect.name for one in named} == set(final.names) == {"friction", "time_offset"}


def test_causes_that_turn_round_with_the_motion_name_nothing_together() -> None:
    """A cable's pull on tissue by Fung had been explained, with certainty, by friction and a sensor's hysteresis."""
    assert shared_variables((FRICTION, SENSOR_HYSTERESIS)) == ("time since reversal",)
    assert shared_variables((TIP_INERTIA, BACKLASH, FRICTION)) == ("time since reversal",)
    assert not shared_variables((FRICTION, TIME_OFFSET))
