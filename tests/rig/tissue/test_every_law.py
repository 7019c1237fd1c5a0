"""What every law of the registry keeps, whatever its formula."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.errors import UsageError
from rig.tissue.history import History
from rig.tissue.laws import Law
from rig.tissue.registry import LAWS, THREE_PARAMETER, law_named
from tests.rig.tissue.examples import EXAMPLES

every_law = pytest.mark.parametrize("law", EXAMPLES, ids=[law.name for law in EXAMPLES])
depths_mm = st.floats(0.01, 12.0)
rates_mm_s = st.floats(0.0, 60.0)


def test_there_is_an_example_of_every_law_there_is() -> None:
    assert {law.name for law in EXAMPLES} == set(LAWS)
    assert law_named("kelvin_voigt") is law_named("constant")


@every_law
@settings(max_examples=30)
@given(depth_mm=depths_mm, more_mm=st.floats(0.001, 5.0), rate_mm_s=rates_mm_s)
def test_force_grows_with_depth_and_never_falls_with_speed(
    law: Law, depth_mm: float, more_mm: float, rate_mm_s: float
) -> None:
    force_N = float(law.force(depth_mm, rate_mm_s))
    assert float(law.force(depth_mm + more_mm, rate_mm_s)) > force_N > 0
    assert float(law.force(depth_mm, rate_mm_s + 1.0)) >= force_N * (1 - 1e-12)


@every_law
@settings(max_examples=30)
@given(depth_mm=depths_mm, rate_mm_s=rates_mm_s)
def test_depth_undoes_force(law: Law, depth_mm: float, rate_mm_s: float) -> None:
    assert float(law.depth(law.force(depth_mm, rate_mm_s), rate_mm_s)) == pytest.approx(depth_mm, rel=1e-6)


@every_law
@settings(max_examples=30)
@given(depth_mm=depths_mm)
def test_the_slope_is_the_derivative_at_rest_and_the_tangent_that_of_a_sudden_move(law: Law, depth_mm: float) -> None:
    h = 1e-5 * depth_mm
    at_rest = float(law.force(depth_mm + h) - law.force(depth_mm - h)) / (2 * h)
    assert float(law.slope(np.array(depth_mm))) == pytest.approx(at_rest, rel=1e-5)
    path_mm = np.array([depth_mm, depth_mm + h])
    sudden = np.diff(law.force(path_mm, 0.0, History.at([0.0, 1e-9])))[0] / h
    assert float(law.tangent_stiffness(depth_mm)) == pytest.approx(sudden, rel=1e-4)


@every_law
def test_the_secant_is_force_at_rest_over_depth_and_meets_the_slope_at_contact(law: Law) -> None:
    depth_mm = np.array([0.5, 3.0, 9.0])
    assert law.secant_stiffness(depth_mm) == pytest.approx(law.force(depth_mm) / depth_mm)
    assert law.secant_stiffness(0.0) == pytest.approx(law.slope(np.zeros(1))[0])


@every_law
def test_nothing_acts_outside_the_tissue(law: Law) -> None:
    depth_mm, history = np.array([-3.0, -1e-9]), History.at([0.0, 0.1])
    for found in (law.force(depth_mm, 10.0), law.force(depth_mm, 10.0, history), law.tangent_stiffness(depth_mm)):
        assert found == pytest.approx([0.0, 0.0])
    assert law.depth([-1.0, 0.0]) == pytest.approx([0.0, 0.0])


@every_law
def test_the_stiffness_of_a_path_is_what_its_forces_gain_where_it_lies_deeper(law: Law) -> None:
    time_s = np.linspace(0.0, 0.6, 40)
    depth_mm, history, h = 12.0 * time_s + 0.1, History.at(time_s), 1e-6
    grown = (law.force(depth_mm + h, 12.0, history) - law.force(depth_mm - h, 12.0, history)) / (2 * h)
    assert law.path_stiffness(depth_mm, np.full(40, 12.0), history) == pytest.approx(grown, rel=1e-6)


@every_law
def test_a_path_at_one_speed_needs_no_history(law: Law) -> None:
    time_s = np.linspace(0.0, 0.5, 2001)
    path_N = law.force(16.0 * time_s, 16.0, History.at(time_s))
    assert path_N[1:] == pytest.approx(law.force(16.0 * time_s[1:], 16.0), rel=2e-4)


@every_law
def test_the_guess_is_near_the_law_that_made_the_data(law: Law) -> None:
    depth_mm = np.linspace(0.2, 8.0, 60)
    guessed = type(law).guess(depth_mm, law.elastic(depth_mm))
    carried = guessed.elastic(depth_mm) * guessed.sudden**0.5
    assert np.median(np.abs(carried / law.elastic(depth_mm) - 1)) < 0.2


@every_law
def test_parameters_have_unit_bounds_and_meaning_and_rebuild_the_law(law: Law) -> None:
    assert type(law).from_values(law.values) == law
    assert set(law.bounds) == {field.name for field in dataclasses.fields(law)}
    for parameter in law.parameters:
        assert parameter.lower <= parameter.value <= parameter.upper
        assert law.bounds[parameter.name].meaning
        assert parameter.unit


@every_law
@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_a_parameter_no_tissue_has_is_refused_with_its_bounds(law: Law, value: float) -> None:
    for name, bounds in law.bounds.items():
        with pytest.raises(UsageError, match=rf"{law.name} law: {name} = .* is outside {bounds.lower:g} to"):
            dataclasses.replace(law, **{name: value})


def test_alternatives_have_as_many_parameters_as_the_index_model() -> None:
    assert {len(kind.bounds) for kind in THREE_PARAMETER} == {3}
