"""Elastic laws of other forms are planted by other code, and named with their size where the index law was extended."""

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.forms import tissue
from rig.config.protocol import Indentation
from rig.diagnosis.answers import intervals
from rig.diagnosis.design import SURFACE_MM, planned
from rig.diagnosis.effects.tissue import QUADRATIC_LAW, SUBSTRATE
from rig.diagnosis.evidence import tangents
from rig.diagnosis.fit import best_fit, first_fit
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.observations import observe
from rig.diagnosis.other_forms import with_best_form
from rig.diagnosis.problem import Effect
from rig.diagnosis.search import Named, Search, gain_over
from rig.diagnosis.support import Support
from rig.tissue.index_law import fung_form, layer_form, ogden_form
from rig.trials.trial import TrialSet

Array = np.ndarray
PROTOCOL = Indentation(speeds_mm_s=(5, 12, 25), trials=2, depth_mm=6, hold_s=0.3)
NOISE_N = 0.004
DEPTHS = np.linspace(0.01, 7, 50)


def problem_of(law: Callable[[Array], Array]) -> IndentationProblem:
    """Six cycles on a tissue of this law and nothing else, touched anew each time."""
    rng, cycles = np.random.default_rng(3), []
    for cycle in planned(PROTOCOL, False, 250.0):
        depth = cycle.axis_mm - SURFACE_MM - rng.normal(0, 0.01)
        force = law(np.maximum(depth, 0.0)) + rng.normal(0, NOISE_N, len(depth))
        cycles.append(type(cycle)(cycle.name, cycle.force_s, force, cycle.axis_s, cycle.axis_mm))
    return IndentationProblem(observe(TrialSet("made", tuple(cycles))))


def found_with(problem: IndentationProblem, extension: Effect) -> Search:
    """What a search ends with that named one extension of the index law."""
    before = first_fit(problem)
    start = {**before.values, extension.amplitudes[0].name: extension.amplitudes[0].scale}
    after = best_fit(problem, (extension,), start, before.whitener)
    assert after is not None
    gains = np.full(problem.recordings, 10.0)
    named = Named(extension, (), gains, 0.01, before, 1.0, Support(gains, gains))
    return Search(before, after, (named,), tangents(after, ()), (gains, gains), ())


@pytest.mark.parametrize(
    ("law", "extension", "name", "sizes"),
    [
        (tissue.fung(0.2, 0.45), SUBSTRATE, "elastic_law", {"fung_per_mm": 0.45}),
        (tissue.ogden_block(0.3, 15.0, 8.0), SUBSTRATE, "elastic_law", {"ogden_per_mm": 1 / 15, "ogden_exponent": 8.0}),
        (tissue.thin_layer(0.03, 8.0, 4.0), QUADRATIC_LAW, "substrate", {"layer_ratio": np.sqrt(8.0 * 5.0) / 4.0}),
    ],
    ids=["Fung", "Ogden", "layer"],
)
def test_a_law_of_another_form_is_named_with_its_size(
    law: Callable[[Array], Array], extension: Effect, name: str, sizes: dict[str, float]
) -> None:
    search = found_with(problem_of(law), extension)
    final = with_best_form(search)
    (one,) = final.named
    assert one.effect.name == name
    assert gain_over(final.after, search.after) > 3
    found = intervals(final.after, one.effect.pars)
    for parameter, size in sizes.items():
        assert found[parameter].low <= size <= found[parameter].high, (parameter, size, found[parameter])


def test_an_extension_that_is_true_stays() -> None:
    search = found_with(problem_of(lambda x: 0.15 * x * np.exp(0.15 * x) * (1 + 0.003 * x**3)), SUBSTRATE)
    assert with_best_form(search).named[0].effect is SUBSTRATE


@pytest.mark.parametrize(
    ("made", "form"),
    [
        (tissue.fung(1.0, 0.4), lambda x: x * fung_form(x, 0.4)),
        (tissue.ogden_block(1.0, 16.0, 6.0), lambda x: x * ogden_form(x, 1 / 16, 6.0)),
        # Neo-Hookean: force over area mu (1 / l^2 - l), mu a third of the slope.
        (lambda x: 12 / 3 * ((1 - x / 12) ** -2 - (1 - x / 12)), lambda x: x * ogden_form(x, 1 / 12, 2.0)),
        (
            tissue.thin_layer(9 / 16 / np.sqrt(5), 8.0, 10.0),
            lambda x: np.sqrt(8.0) * x * layer_form(x, np.sqrt(8.0 * 5.0) / 10.0),
        ),
    ],
)
def test_forms_are_those_of_the_literature(made: Callable[[Array], Array], form: Callable[[Array], Array]) -> None:
    np.testing.assert_allclose(form(DEPTHS), made(DEPTHS), rtol=1e-6)
