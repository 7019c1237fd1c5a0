"""A protocol laid out on the user's own tissue: what it can show there follows from its stiffness and what is known."""

import numpy as np
import pytest

from rig.config.protocol import Indentation
from rig.diagnosis.design import LIMB, SURFACE_MM, check, limb_of
from rig.tissue.index_law import index_force
from rig.tissue.laws import Law
from rig.tissue.laws_elastic import Fung
from rig.tissue.laws_extended import Extended
from rig.tissue.laws_viscous import Prony, QuasiLinear
from rig.tissue.model import Model, Provenance, Quality, ValidRange

SHORT = Indentation(speeds_mm_s=(5, 10, 20), trials=2, hold_s=0.2)


def model_of(law: Law, deepest_mm: float = 8.0) -> Model:
    """What a model file holds, with a covariance of nothing."""
    size = len(law.parameters)
    return Model(
        law=law, covariance=np.zeros((size, size)), intervals={}, interval_level=0.95, interval_method="",
        valid=ValidRange(depth_mm=deepest_mm, force_N=5.0, speeds_mm_s=(10.0,)),
        data=Provenance(session="thigh", trials=("a",), sha256="0" * 64, software="tissue-rig 0"),
        quality=Quality(rmse_N=0.0, max_error_mm=0.0, max_error_percent=0.0),
    )  # fmt: skip


def test_a_share_of_the_tissues_force_shows_in_proportion_to_stiffness_and_what_adds_to_it_does_not() -> None:
    soft, stiff = (check(SHORT, tracker=False, limb={**LIMB, "a_N_mm": a}).detectable for a in (0.003, 0.012))
    # Another exponent changes force in proportion to it, against noise that stays as it is.
    assert soft["elastic_law"].minimum / stiff["elastic_law"].minimum == pytest.approx(4, rel=0.1)
    assert soft["zero_drift"].minimum / stiff["zero_drift"].minimum == pytest.approx(1, rel=0.1)
    assert stiff["elastic_law"].minimum > 0.03 and stiff["zero_drift"].minimum > 0.1  # less is never named


def test_what_the_model_holds_already_is_neither_looked_for_nor_called_invisible() -> None:
    index = {name: LIMB[name] for name in ("a_N_mm", "b_per_mm", "damping_N_s_mm")}
    law = Extended.clipped(**{**Extended.known, **index, "friction_N": 0.2, "relaxation_ratio": 0.3})
    found = check(SHORT, tracker=False, limb=limb_of(model_of(law), 8.0))
    assert not {"friction", "relaxation"} & (found.detectable.keys() | found.not_testable.keys())
    assert {"backlash", "time_offset"} <= found.detectable.keys()


def test_another_law_becomes_the_index_law_nearest_to_it_with_its_relaxation() -> None:
    fung = QuasiLinear(A_N=0.6, b_per_mm=0.25, relaxation_ratio=0.3, tau_s=0.4)
    limb = limb_of(model_of(fung), 8.0)
    depth_mm = np.linspace(2, 8, 20)
    assert index_force(depth_mm, limb["a_N_mm"], limb["b_per_mm"]) == pytest.approx(fung.elastic(depth_mm), rel=0.05)
    assert (limb["relaxation_ratio"], limb["tau_s"]) == (0.3, 0.4)
    assert limb["surface_mm"] == SURFACE_MM


def test_of_several_relaxations_the_largest_is_taken() -> None:
    law = Prony(k_N_mm=0.2, k1_N_mm=0.05, tau1_s=0.3, k2_N_mm=0.02, tau2_s=3.0)
    assert limb_of(model_of(law), 8.0)["tau_s"] == 0.3


def test_a_law_is_not_asked_beyond_what_was_fitted() -> None:
    law = Fung(A_N=0.6, b_per_mm=0.25, damping_N_s_mm=0.01)
    assert limb_of(model_of(law, deepest_mm=2.0), 8.0) == limb_of(model_of(law, deepest_mm=2.0), 2.0)
