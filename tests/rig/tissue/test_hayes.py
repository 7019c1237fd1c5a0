"""kappa against values computed by an independent program, and against its limits."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.errors import UsageError
from rig.tissue.hayes import layer_factor, punch_stiffness_N_mm
from rig.tissue.laws_elastic import Layer

TABLE = {
    0.25: (1.044, 1.092, 1.143, 1.198, 1.318, 1.451, 1.745, 2.398),
    0.45: (1.054, 1.115, 1.180, 1.252, 1.414, 1.599, 2.033, 3.091),
    0.5: (1.060, 1.126, 1.200, 1.281, 1.466, 1.684, 2.213, 3.619),
}
RATIOS = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 1.0)


@pytest.mark.parametrize("nu", TABLE)
def test_factor_to_three_decimals(nu: float) -> None:
    assert [round(layer_factor(ratio, nu), 3) for ratio in RATIOS] == list(TABLE[nu])


def test_a_thick_layer_is_a_half_space() -> None:
    assert layer_factor(1e-4, 0.3) == pytest.approx(1.0, abs=2e-4)
    assert punch_stiffness_N_mm(0.25, 0.25, 3.0, 3e5) == pytest.approx(1.6, rel=1e-4)


def test_a_thin_compressible_layer_is_squeezed_like_a_disc() -> None:
    # For a/h -> infinity the punch sees the confined modulus over its area: kappa -> pi a (1-nu)^2 / (2 h (1-2 nu)).
    nu, ratio = 0.25, 3.0
    confined = 3.14159265 * ratio * (1 - nu) ** 2 / (2 * (1 - 2 * nu))
    assert confined < layer_factor(ratio, nu) < 1.3 * confined


@settings(max_examples=20)
@given(st.floats(0.01, 2.5), st.floats(0.0, 0.5))
def test_thinner_layers_are_stiffer(ratio: float, nu: float) -> None:
    assert 1.0 < layer_factor(ratio, nu) < layer_factor(1.1 * ratio, nu)


@pytest.mark.parametrize(("ratio", "nu"), [(0.0, 0.3), (3.5, 0.3), (float("nan"), 0.3), (0.1, 0.6), (0.1, -0.1)])
def test_outside_its_range_it_refuses(ratio: float, nu: float) -> None:
    with pytest.raises(UsageError, match="must lie"):
        layer_factor(ratio, nu)


def test_the_layer_law_is_a_flat_punch_on_deep_tissue_where_the_layer_is_thick() -> None:
    thick = Layer(E_MPa=0.05, radius_mm=3.0, thickness_mm=5000.0, poisson_ratio=0.3, damping_N_s_mm=0.0)
    assert thick.force(2.0) == pytest.approx(2 * 3.0 * 0.05 / (1 - 0.3**2) * 2.0, rel=2e-3)
    thin = replace(thick, thickness_mm=15.0)
    assert thin.tangent_stiffness(1.0) == pytest.approx(
        thick.tangent_stiffness(1.0) * layer_factor(0.2, 0.3) / layer_factor(0.0006, 0.3)
    )


def test_a_tip_too_wide_for_its_layer_is_refused() -> None:
    with pytest.raises(UsageError, match=r"tip radius over tissue thickness is 4; .* not above 3"):
        Layer(E_MPa=0.05, radius_mm=4.0, thickness_mm=1.0, poisson_ratio=0.3, damping_N_s_mm=0.0)
