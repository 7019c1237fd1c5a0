"""The diagnosis begins where the estimator of contact found the surface, pressed, pulled or from the air."""

from dataclasses import replace

import numpy as np
import pytest

from rig.diagnosis.indentation import IndentationProblem, surface
from rig.diagnosis.observations import observe
from rig.trials.trial import Trial, TrialSet

RATE_HZ, START_MM, NOISE_N = 100.0, 5.0, 0.002


def session(surface_mm: float) -> TrialSet:
    """Four strokes of 10 mm from 5 mm on, at two speeds, on tissue of the index law without zero of its own."""
    trials, random = [], np.random.default_rng(3)
    for number, speed_mm_s in enumerate((2.0, 5.0) * 2):
        way_mm = np.concatenate([np.zeros(50), np.arange(0, 10, speed_mm_s / RATE_HZ)])
        place_mm = START_MM + np.concatenate([way_mm, way_mm[::-1]])
        depth_mm = np.maximum(place_mm - surface_mm, 0.0)
        force_N = 0.1 * depth_mm * np.exp(0.2 * depth_mm) + NOISE_N * random.standard_normal(len(depth_mm))
        time_s = 100.0 * number + np.linspace(0.0, (len(force_N) - 1) / RATE_HZ, len(force_N))
        trials.append(Trial(f"stroke {number}", time_s, force_N, time_s, place_mm))
    return TrialSet("made", tuple(trials))


@pytest.mark.parametrize("surface_mm", [4.8, 8.0])
def test_the_fit_begins_at_the_surface_though_it_lies_above_the_start(surface_mm: float) -> None:
    data = observe(session(surface_mm))
    assert data.contact_mm
    assert data.contact_mm[0] <= surface_mm <= data.contact_mm[1]
    problem = IndentationProblem(data)
    assert problem.start()["surface_mm"] == pytest.approx(surface_mm, abs=0.3)
    assert surface(data) in problem.base
    assert surface(data).low < surface_mm < surface(data).high


def test_a_start_far_from_where_contact_was_found_is_not_tried() -> None:
    data = replace(observe(session(8.0)), contact_mm=(11.9, 12.1))
    assert IndentationProblem(data).start()["surface_mm"] >= 11.9 - 2.5


def test_what_is_pulled_is_seen_as_what_is_pushed() -> None:
    made = session(4.8)
    pulled = tuple(replace(trial, force_N=-trial.force_N, axis_mm=-trial.axis_mm) for trial in made.trials)
    pushed, turned = observe(made), observe(replace(made, trials=pulled))
    assert turned.force_N == pytest.approx(pushed.force_N)
    assert turned.drive.position_mm == pytest.approx(pushed.drive.position_mm)
    assert [finding.kind for finding in turned.findings] == ["tension"]
    assert turned.findings[0].recordings == 4
