"""Strokes of one speed, as testing machines make them: a damper does nothing there that a zero does not."""

from dataclasses import replace

import numpy as np
import pytest

from rig.diagnosis import search
from rig.diagnosis.evidence import tangents
from rig.diagnosis.fit import first_fit
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.observations import observe
from rig.trials.trial import Trial
from tests.rig.diagnosis import made_tissue
from tests.rig.diagnosis.made_tissue import MadeTissue

RIPPLE = 0.03, 1.3  # mm, pitch in mm
STIFFENING = MadeTissue(a_N_mm=0.1, b_per_mm=0.0, power=1.5, damping_N_s_mm=0.0, ripple=RIPPLE)


def way_in(trial: Trial) -> Trial:
    """From within the tissue until shortly before the axis slows down."""
    deep = (trial.axis_mm > made_tissue.SURFACE_MM + 0.3) & (trial.axis_mm < trial.axis_mm.max() - 1.0)
    rows = slice(int(np.argmax(deep)), int(np.argmax(trial.axis_mm > trial.axis_mm.max() - 1.0)))
    return replace(
        trial, force_s=trial.force_s[rows], force_N=trial.force_N[rows], axis_s=trial.axis_s[rows],
        axis_mm=trial.axis_mm[rows], temperature_C=None,
    )  # fmt: skip


def strokes(made: MadeTissue, monkeypatch: pytest.MonkeyPatch) -> IndentationProblem:
    """Eight ways in at 10 mm/s, by a screw whose pitch shows."""
    monkeypatch.setattr(made_tissue, "SPEEDS_MM_S", (10.0,) * 8)
    session = made.session()
    return IndentationProblem(observe(replace(session, trials=tuple(map(way_in, session.trials)))))


def test_no_damper_drives_the_tip_and_a_ripple_has_its_size(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = strokes(STIFFENING, monkeypatch)
    model = first_fit(problem)
    assert model.values["damping_N_s_mm"] >= 0.0
    best = search.candidates(model, tangents(model, search.testable(problem)))[0]
    assert best.names == ("position_ripple",)
    assert np.hypot(best.values["ripple_sin_mm"], best.values["ripple_cos_mm"]) == pytest.approx(RIPPLE[0], rel=0.1)
    assert best.values["ripple_pitch_mm"] == pytest.approx(RIPPLE[1], rel=0.01)
