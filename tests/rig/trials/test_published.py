"""Every published recording of a stroke gives a curve, or is refused for what is wrong with it."""

from collections.abc import Sequence

import pytest

from rig.errors import DataError
from rig.trials.curves import Curve, loading_curve
from rig.trials.cycles import cycle_of
from rig.trials.trial import Trial
from tests.rig.trials.published import elastomer, machine_strokes, well_plate


def answered(trials: Sequence[Trial]) -> tuple[list[Curve], list[str]]:
    """The curves, and why the other trials have none."""
    curves, refused = [], []
    for trial in trials:
        try:
            curves.append(loading_curve(cycle_of(trial)))
        except DataError as error:
            refused.append(str(error))
    return curves, refused


def test_strokes_of_a_testing_machine_from_air_surface_and_preload() -> None:
    curves, refused = answered(machine_strokes())
    assert len(curves) > 240
    # One of these is the machine's stroke without a specimen.
    others = [reason for reason in refused if "started in contact" not in reason]
    assert all("its surface lies between" in reason for reason in others)
    assert len(others) <= 2
    assert all(curve.max_depth_mm > 1 and curve.max_force_N > 0.2 for curve in curves)


def test_clamped_strips_begin_unloaded_at_their_start() -> None:
    curves, refused = answered(elastomer())
    assert not refused
    for curve in curves:
        assert "started in contact" in curve.findings[0].text
        # Slack at the end, or untouched at the start: the load cell's zero is within millinewtons.
        assert curve.zero_N == pytest.approx(0.0, abs=0.02)
        assert curve.contact.lower_mm < 0 < curve.contact.upper_mm
        assert curve.max_force_N > 0.6


def test_wells_sampled_millimetres_apart_are_refused_for_that() -> None:
    curves, refused = answered(well_plate())
    assert len(curves) + len(refused) == 24
    assert len(curves) >= 15
    assert all("its surface lies between" in reason or "no contact" in reason for reason in refused)
