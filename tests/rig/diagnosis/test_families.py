"""What any elastic law takes of a cause is what one session cannot tell from another law, and is said so."""

from dataclasses import replace

import numpy as np
import pytest

from rig.config.protocol import Indentation
from rig.diagnosis.design import LIMB, noiseless, planned
from rig.diagnosis.effects.bench import FRICTION, POSITION_RIPPLE
from rig.diagnosis.effects.memory import RELAXATION
from rig.diagnosis.effects.tissue import ELASTIC_LAW, HUNT_CROSSLEY, PRECONDITIONING, QUADRATIC_LAW, SUBSTRATE
from rig.diagnosis.estimates import ErrorGain, NamedCause
from rig.diagnosis.evidence import tangents
from rig.diagnosis.families import taken_by_elasticity, with_families
from rig.diagnosis.fit import Fit, assemble
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.observations import observe
from rig.diagnosis.problem import Effect
from rig.diagnosis.search import Named, Search
from rig.diagnosis.support import Support
from rig.diagnosis.verdict import summary
from rig.trials.trial import TrialSet

# Three speeds and a hold: enough to tell what depends on time from what depends on depth.
PROTOCOL = Indentation(speeds_mm_s=(5, 12, 25), trials=2, depth_mm=7, hold_s=0.5)


@pytest.fixture(scope="module")
def problem() -> IndentationProblem:
    """Six cycles on the limb of a protocol check, without noise."""
    return IndentationProblem(observe(TrialSet("planned", tuple(planned(PROTOCOL, False, 250.0)))))


def model(problem: IndentationProblem, *effects: Effect, **sizes: float) -> Fit:
    """A limb with these effects, as if it had been fitted."""
    plain = noiseless(problem)
    return assemble(plain.problem, effects, {**plain.values, **LIMB, **sizes}, plain.whitener)


def test_an_elastic_law_takes_all_of_another_and_little_of_what_remembers_or_rubs(problem: IndentationProblem) -> None:
    others = {"relaxation_ratio": 0.2, "tau_s": 0.3, "friction_N": 0.1, "friction_length_mm": 0.1}
    fit = model(problem, SUBSTRATE, RELAXATION, FRICTION, substrate_per_mm3=0.001, **others)
    taken = taken_by_elasticity(fit, [SUBSTRATE, ELASTIC_LAW, RELAXATION, FRICTION])
    assert min(taken["substrate_per_mm3"], taken["exponent"]) > 0.9
    assert max(taken["relaxation_ratio"], taken["friction_N"]) < 0.3


@pytest.mark.parametrize(
    ("cause", "sizes"),
    [
        (PRECONDITIONING, {"preconditioning_gain": 0.25, "preconditioning_cycles": 2.0}),
        (HUNT_CROSSLEY, {"hunt_crossley_s_mm": 0.02}),
    ],
)
def test_what_scales_the_force_of_the_law_is_no_law_but_leaves_a_family_one(
    problem: IndentationProblem, cause: Effect, sizes: dict[str, float]
) -> None:
    fit = model(problem, SUBSTRATE, cause, substrate_per_mm3=0.001, **sizes)
    taken = taken_by_elasticity(fit, [SUBSTRATE, cause])
    assert taken["substrate_per_mm3"] > 0.9
    assert taken[cause.key] < 0.1


@pytest.mark.parametrize(("pitch_mm", "is_taken"), [(0.7, False), (6.0, True)])
def test_a_ripple_is_a_law_where_it_has_one_period_and_none_where_it_has_ten(
    problem: IndentationProblem, pitch_mm: float, is_taken: bool
) -> None:
    fit = model(problem, POSITION_RIPPLE, ripple_sin_mm=0.05, ripple_pitch_mm=pitch_mm)
    assert (taken_by_elasticity(fit, [POSITION_RIPPLE])["ripple_sin_mm"] > 0.5) is is_taken


@pytest.mark.parametrize(
    ("cause", "sizes", "family"),
    [
        (SUBSTRATE, {"substrate_per_mm3": 0.001}, {"elastic_law"}),
        (QUADRATIC_LAW, {"quadratic_per_mm": 0.2}, {"substrate"}),
        (POSITION_RIPPLE, {"ripple_sin_mm": 0.05, "ripple_pitch_mm": 6.0}, {"elastic_law"}),
        (RELAXATION, {"relaxation_ratio": 0.2, "tau_s": 0.3}, set()),
    ],
)
def test_a_name_comes_with_those_of_its_family(
    problem: IndentationProblem, cause: Effect, sizes: dict[str, float], family: set[str]
) -> None:
    fit = model(problem, cause, **sizes)
    gains = np.ones(problem.recordings)
    named = Named(cause, (), gains, 0.01, fit, 1.0, Support(gains, gains))
    found = with_families(Search(fit, fit, (named,), tangents(fit, ()), (gains, gains), ()))
    assert set(found.named[0].family) == family
    assert found.named[0].effect is cause


def test_the_sentence_says_why_a_family_is_one() -> None:
    gain = ErrorGain(0.02, 0.01, 0.5, 0.4, 0.6)
    found = NamedCause(
        ("substrate", "elastic_law"), "something stiff", 1.0, {}, gain, 50.0, 0.01, "", False, 5.0, "depth"
    )
    said = summary("explained", [found], (), "index", None)
    assert "(or elastic_law: through the depth alone all do the same, and another tip, thickness" in said
    apart = summary("explained", [replace(found, shared_variable=None)], (), "index", None)
    assert apart == "The index simulation is wrong because something stiff (or elastic_law)."
