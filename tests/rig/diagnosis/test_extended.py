"""The extended model of a diagnosis is one to control by, or there is none."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from rig.diagnosis import extended
from rig.diagnosis.answers import intervals
from rig.diagnosis.effects.registry import CAUSES
from rig.diagnosis.estimates import ErrorGain, NamedCause
from rig.diagnosis.fit import Fit
from rig.errors import DataError
from rig.tissue.laws_extended import Extended

DEEPEST_MM = 10.0


@pytest.fixture
def fit(monkeypatch: pytest.MonkeyPatch) -> Fit:
    monkeypatch.setattr(extended, "_depth_mm", lambda _: np.array([0.0, DEEPEST_MM]))
    return cast("Fit", SimpleNamespace(residual=np.array([0.1, -0.3])))


def test_a_force_that_falls_with_depth_is_no_model(fit: Fit) -> None:
    falling = Extended(a_N_mm=1.0, b_per_mm=-0.5, damping_N_s_mm=0.0)  # x exp(-x/2) falls beyond 2 mm
    with pytest.raises(DataError, match=r"at 5 mm the fitted force does not rise with depth .* no model to control by"):
        extended._quality(fit, falling)


def test_errors_of_force_are_turned_into_depth_by_the_tangent(fit: Fit) -> None:
    found = extended._quality(fit, Extended(a_N_mm=2.0, b_per_mm=0.0, damping_N_s_mm=0.0))
    assert found.max_error_mm == pytest.approx(0.3 / 2.0)
    assert found.max_error_percent == pytest.approx(100 * 0.15 / DEEPEST_MM)


@pytest.mark.parametrize("name", CAUSES)
def test_every_cause_stands_in_the_model_with_its_units(name: str) -> None:
    cause = CAUSES[name]
    values, count = {par.name: par.null + par.scale for par in cause.pars}, len(cause.pars)
    one = cast("Fit", SimpleNamespace(values=values, free=cause.pars))
    sizes = intervals(one, cause.pars, [np.zeros((1, count, count))])
    gain = ErrorGain(0.02, 0.01, 0.5, 0.4, 0.6)
    found = NamedCause((cause.name,), "it differs", 0.9, sizes, gain, 50.0, 0.01, "mend it", provisional=False)
    (stands,) = extended.causes_of((found,), [cause])
    units = {par.name.replace("_sin_", "_"): par.unit for par in cause.pars if "_cos_" not in par.name}
    assert {name: size.unit for name, size in stands.parameters.items()} == units
