"""What one model is asked for twice is worked out once."""

from dataclasses import replace
from unittest.mock import patch

import pytest

from rig.diagnosis.fit import Fit, first_fit, least_squares
from rig.diagnosis.flexible import Flexible
from rig.diagnosis.floor import error_budget
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.observations import observe
from tests.rig.diagnosis.made_tissue import MadeTissue


@pytest.fixture(scope="module")
def model() -> Fit:
    """The simulation fitted to eight strokes with a tracker."""
    return first_fit(IndentationProblem(observe(MadeTissue().session(tracker=True))))


def test_what_any_tissue_could_reach_is_worked_out_once_a_model(model: Fit) -> None:
    with patch.object(Flexible, "left_out", autospec=True, side_effect=Flexible.left_out) as counted:
        first, again = error_budget(model, model), error_budget(model, model)
    assert counted.call_count == 1
    assert first.floor_N == again.floor_N


def test_least_squares_of_one_model_are_sought_once_and_of_another_anew(model: Fit) -> None:
    assert least_squares(model) is least_squares(model)
    assert least_squares(model) is not least_squares(replace(model))
