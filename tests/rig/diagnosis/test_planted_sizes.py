"""Every cause planted by its textbook equation (`made_tissue`): the search puts its name first, and finds its size.

What a whole diagnosis says of hidden causes is in `tests/hidden`; here it is the first step of the search, in a second.
"""

from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from rig.diagnosis import search
from rig.diagnosis.answers import intervals
from rig.diagnosis.effects.registry import CAUSES
from rig.diagnosis.evidence import tangents
from rig.diagnosis.fit import Fit, best_fit, first_fit
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.observations import observe
from tests.rig.diagnosis.made_tissue import RISING_MM, MadeTissue, exponentials

pytestmark = pytest.mark.campaign

SIZED_SHARE = 0.1  # of what is planted; a size lies inside its interval too


class Planted(NamedTuple):
    """A session, the sizes a cause has there, and where the fit of those begins that it is looked for beside."""

    made: MadeTissue
    sizes: Mapping[str, float]
    beside: Mapping[str, float] = {}
    tracker: bool = False
    stated: bool = False


PLANTED = {
    "exponent": Planted(MadeTissue(a_N_mm=0.25, b_per_mm=0.0, power=1.7), {"exponent": 1.7}),
    "quadratic_per_mm": Planted(MadeTissue(b_per_mm=0.0, quadratic_N_mm2=0.08), {"quadratic_per_mm": 0.4}),
    "substrate_per_mm3": Planted(MadeTissue(substrate_per_mm3=2e-3), {"substrate_per_mm3": 2e-3}),
    "rate_exponent": Planted(MadeTissue(rate_exponent=0.5, damping_N_s_mm=0.02), {"rate_exponent": 0.5}),
    "hunt_crossley_s_mm": Planted(
        MadeTissue(hunt_crossley_s_mm=0.01, damping_N_s_mm=0.0), {"hunt_crossley_s_mm": 0.01}
    ),
    "mullins_share": Planted(
        MadeTissue(mullins=(0.3, 0.4), depths_mm=RISING_MM), {"mullins_share": 0.3, "mullins_energy": 0.4}
    ),
    "preconditioning_gain": Planted(MadeTissue(first=(0.3, 2.0)), {"preconditioning_gain": 0.3}),
    "adhesion_N": Planted(MadeTissue(adhesion=(0.2, 0.8)), {"adhesion_N": 0.2, "adhesion_length_mm": 0.8}),
    "temperature_per_K": Planted(MadeTissue(per_K=0.04), {"temperature_per_K": 0.04}),
    "relaxation_ratio": Planted(MadeTissue(fading=exponentials((0.25, 0.4))), {"relaxation_ratio": 0.25, "tau_s": 0.4}),
    "second_ratio": Planted(
        MadeTissue(fading=exponentials((0.25, 0.8), (0.3, 0.04))),
        {"relaxation_ratio": 0.25, "tau_s": 0.8, "second_ratio": 0.3, "second_tau_s": 0.04},
        {"relaxation_ratio": 0.2, "tau_s": 0.5},
    ),
    "third_ratio": Planted(
        MadeTissue(fading=exponentials((0.4, 0.015), (0.4, 0.12), (0.4, 1.0))),
        {
            "relaxation_ratio": 0.4,
            "tau_s": 0.12,
            "second_ratio": 0.4,
            "second_tau_s": 1.0,
            "third_ratio": 0.4,
            "third_tau_s": 0.015,
        },
        {"relaxation_ratio": 0.5, "tau_s": 0.1, "second_ratio": 0.5, "second_tau_s": 0.7},
    ),
    "relaxation_spread": Planted(
        MadeTissue(fading=lambda t: np.asarray(0.5 * (1 + t / 0.03) ** -0.4)),
        {"relaxation_ratio": 0.5, "relaxation_spread": 2.5},
        {"relaxation_ratio": 0.4, "tau_s": 0.2},
    ),
    "backlash_mm": Planted(MadeTissue(backlash_mm=0.2), {"backlash_mm": 0.2}),
    "frame_compliance_mm_N": Planted(
        MadeTissue(compliance_mm_N=0.05, damping_N_s_mm=0.0), {"frame_compliance_mm_N": 0.05}, tracker=True
    ),
    "ripple_sin_mm": Planted(MadeTissue(ripple=(0.05, 1.4)), {"ripple_mm": 0.05, "ripple_pitch_mm": 1.4}),
    "contact_offset_mm": Planted(MadeTissue(surface_off_mm=0.3), {"contact_offset_mm": 0.3}, stated=True),
    "surface_motion_sin_mm": Planted(
        MadeTissue(breath=(0.2, 0.3)), {"surface_motion_mm": 0.2, "surface_motion_Hz": 0.3}
    ),
    "surface_harmonic_sin_mm": Planted(
        MadeTissue(uneven_breath=(0.6, 0.3)),
        {"surface_motion_mm": 0.3, "surface_harmonic_mm": 0.075},
        {"surface_motion_sin_mm": 0.2, "surface_motion_cos_mm": 0.2, "surface_motion_Hz": 0.3},
    ),
    "friction_N": Planted(MadeTissue(friction=(0.1, 0.1)), {"friction_N": 0.1, "friction_length_mm": 0.1}),
    "cogging_sin_N": Planted(
        MadeTissue(cogging=(0.06, 1.7)), {"cogging_N": 0.06, "cogging_harmonic_N": 0.018, "cogging_pitch_mm": 1.7}
    ),
    # A square is its chord, and a quarter of it below that in the middle.
    "cross_talk_N": Planted(MadeTissue(cross_talk_N=0.3), {"cross_talk_N": 0.3, "cross_talk_sag_N": 0.075}),
    "tip_inertia_kg": Planted(MadeTissue(mass_kg=0.2), {"tip_inertia_kg": 0.2}),
    "hysteresis_N": Planted(MadeTissue(hysteresis=(0.1, 0.3)), {"hysteresis_N": 0.1, "hysteresis_width_N": 0.3}),
    "filter_lag_s": Planted(MadeTissue(lag_s=0.01), {"filter_lag_s": 0.01}),
    "time_offset_s": Planted(MadeTissue(late_s=0.008), {"time_offset_s": 0.008}),
    "clock_drift_ppm": Planted(MadeTissue(fast_ppm=300.0), {"clock_drift_ppm": 300.0}),
    "tracker_latency_s": Planted(MadeTissue(tracker_late_s=0.03), {"tracker_latency_s": 0.03}, tracker=True),
    "zero_drift_N_h": Planted(MadeTissue(drift_N_h=20.0), {"zero_drift_N_h": 20.0}),
}
NOT_PLANTED = {"gain_error": "it looks like another stiffness without a weight on the tip"}


@cache
def best(key: str) -> tuple[Fit, Fit]:
    """The simulation as it is, and the best model with one cause more than those it is looked for beside."""
    planted = PLANTED[key]
    problem = IndentationProblem(observe(planted.made.session(tracker=planted.tracker, stated=planted.stated)))
    first = first_fit(problem)
    known = tuple(cause for cause in CAUSES.values() if cause.key in planted.beside)
    current = best_fit(problem, known, {**first.values, **planted.beside}, first.whitener) if known else first
    assert current is not None
    library = search.proposed(search.testable(problem), current.names)
    return first, search.candidates(current, tangents(current, library))[0]


@pytest.mark.parametrize("key", PLANTED)
def test_a_planted_cause_is_the_best_and_its_size_is_found(key: str) -> None:
    planted = PLANTED[key]
    _, model = best(key)
    assert model.effects[-1].key == key
    sizes = intervals(model, [par for effect in model.effects for par in effect.pars])
    shapes = {par.name for effect in model.effects for par in effect.shapes}
    for name, size in planted.sizes.items():
        # To a shape nothing is added for what the operators themselves are good for.
        assert name in shapes or sizes[name].low <= size <= sizes[name].high, (name, size, sizes[name])
        assert sizes[name].value == pytest.approx(size, rel=SIZED_SHARE), name


def test_the_mass_of_the_tip_has_no_bias_of_two_percent() -> None:
    """Not the tenth that other sizes are given: an acceleration smoothed more than the force makes it larger."""
    _, model = best("tip_inertia_kg")
    assert model.values["tip_inertia_kg"] == pytest.approx(0.2, rel=0.02)


def test_every_cause_is_planted_with_a_size() -> None:
    # Laws that take the place of the index law are planted in test_forms.
    assert set(PLANTED) | set(NOT_PLANTED) == {key for key, cause in CAUSES.items() if not cause.holds}
