"""How well models of an axis predict recordings in closed loop, from nothing of theirs but set-point and excitation."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.axis_motion import Array
from rig.diagnosis.estimates import AxisPrediction, Estimate, SimulationError
from rig.intake.axis import AxisData, AxisRecording
from rig.intake.mapping import Controller
from rig.simulation.servo import ServoModel, follow

Models = Mapping[str, Mapping[str, float]]
MOST_ROUNDS = 8  # from a regression that is right to 5 % the fit settles in four
SHARE = 0.1  # of a change that is small but visible, for differences: friction has corners


class AxisModel(NamedTuple):
    """Values in the axis' own units, and those fitted, each with a change that is small but visible."""

    values: Mapping[str, float]
    free: Mapping[str, float]


def with_predictions(
    found: Diagnosis, data: AxisData, fitted: Sequence[AxisRecording], controller: Controller | None,
    models: tuple[AxisModel, AxisModel], references: Models, share: Estimate | None,
) -> Diagnosis:  # fmt: skip
    """The diagnosis with every recording simulated by the model before and after, and by those of others."""
    told = AxisPrediction("inverse dynamics", data.units.effort, data.units.position, None, share)
    pushes = all(model.values["inertia"] > 0 for model in models)
    if controller is None or not pushes or any(recording.setpoint is None for recording in data.recordings):
        return replace(found, axis=told)
    before, after = (refined(fitted, controller, model) for model in models)
    compared = {"before": before, "after": after, **references}
    names = {recording.name for recording in fitted}
    left = [recording for recording in data.recordings if recording.name not in names]
    percent = percent_of(left, controller, after) if left else None
    simulated = tuple(_simulated(r, r.name in names, controller, compared) for r in data.recordings)
    return replace(found, simulated=simulated, axis=replace(told, method="closed loop", left_out_percent=percent))


def _simulated(recording: AxisRecording, fitted: bool, controller: Controller, models: Models) -> SimulationError:
    percent = {name: percent_of([recording], controller, model) for name, model in models.items()}
    return SimulationError(recording.name, fitted, percent.pop("before"), percent.pop("after"), percent)


def percent_of(recordings: Sequence[AxisRecording], controller: Controller, model: Mapping[str, float]) -> float:
    """100 |effort - simulated| / |effort| over the recordings."""
    errors = sum(float(np.sum(errors_of(r, controller, model) ** 2)) for r in recordings)
    return 100 * math.sqrt(errors / sum(float(np.nansum(r.effort**2)) for r in recordings))


def errors_of(recording: AxisRecording, controller: Controller, model: Mapping[str, float]) -> Array:
    """Measured less simulated effort at each sample at which it was measured."""
    period_s = float(np.median(np.diff(recording.time_s)))
    setpoint, excitation = _bridged(recording.setpoint), _bridged(recording.excitation)
    assert setpoint is not None
    simulated = follow(setpoint, excitation, period_s, controller, model)
    return np.asarray((recording.effort - simulated)[np.isfinite(recording.effort)])


def _bridged(signal: Array | None) -> Array | None:
    """``signal`` with its gaps filled in straight lines; None where there is none."""
    if signal is None or not np.isnan(signal).any():
        return signal
    told, rows = np.isfinite(signal), np.arange(len(signal))
    return np.interp(rows, rows[told], signal[told])


def refined(recordings: Sequence[AxisRecording], controller: Controller, model: AxisModel) -> dict[str, float]:
    """The model with what was fitted by regression fitted again in closed loop, to the recordings together.

    Regression is biased by what loop and noise share, simulation from the set-point alone is not (Gautier, Janot and
    Vandanjon 2013, "A new closed-loop output error method for parameter identification of robot dynamics"). A dead time
    is a whole number of samples there, and stays.
    """
    free = [name for name in model.free if name in ServoModel.model_fields and name != "dead_time"]

    def left(values: Array) -> Array:
        tried = {**model.values, **dict(zip(free, values.tolist(), strict=True))}
        return np.concatenate([errors_of(recording, controller, tried) for recording in recordings])

    start, steps = (np.array([of[name] for name in free]) for of in (model.values, model.free))

    def slopes(values: Array) -> Array:
        here = left(values)
        return np.stack([(left(values + row) - here) / row.sum() for row in np.diag(SHARE * steps)], axis=1)

    lowest = np.where([name == "inertia" for name in free], 0.1 * start, -np.inf)
    found = least_squares(left, start, slopes, x_scale=steps, bounds=(lowest, np.inf), max_nfev=MOST_ROUNDS)
    return {**model.values, **dict(zip(free, found.x.tolist(), strict=True))}
