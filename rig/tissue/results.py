"""A study as numbers for others: JSON, and one CSV table with a row a given force."""

import csv
import io
import math
from dataclasses import asdict

from rig.tissue.control_table import control_rows
from rig.tissue.judging import LEVEL, Errors, Judged
from rig.tissue.rates import RateTest
from rig.tissue.study import Study, rows


def as_json(study: Study) -> dict[str, object]:
    """Everything `rig fit --json` writes; unknown numbers are null.

    ``max_error_mm`` and ``max_error_percent`` are the largest over all trials and given forces of
    |predicted - measured displacement|, on the curves fitted; under ``held_out`` the same on trials, speeds and
    subjects that the law was not fitted to. ``control`` is what the law means to a force loop; ``rate`` whether speeds
    differ.
    """
    return {
        "session": study.session,
        "trials": [curve.name for curve in study.curves],
        "skipped": [{"trial": trial, "reason": reason} for trial, reason in study.skipped],
        "speeds": [speed._asdict() for speed in study.speeds],
        "force_N": [float(force) for force in study.force_N],
        "closest": study.closest,
        "rate": rate_json(study.rate) if study.rate else None,
        **{name: _judged(judged, study) for name, judged in study.judged.items()},
    }


def _judged(judged: Judged, study: Study) -> dict[str, object]:
    deviations = {p.name: math.sqrt(judged.covariance[i, i]) for i, p in enumerate(judged.law.parameters)}
    return {
        "formula": judged.law.formula,
        "parameters": {
            p.name: {
                "value": p.value,
                "unit": p.unit,
                "standard_error": deviations[p.name],
                "interval": list(judged.intervals[p.name]),
                "at_bound": p.name in judged.fit.at_bounds,
                "known": p.name in judged.fit.known,
            }
            for p in judged.law.parameters
        },
        "interval_level": LEVEL,
        "interval_method": judged.interval_method,
        **(errors_json(judged.fitted) or {}),
        "rows": [{k: _known(v) for k, v in row._asdict().items()} for row in rows(judged.fitted)],
        "held_out": {
            "trials": errors_json(judged.trials_left_out),
            "speeds": errors_json(judged.speeds_left_out),
            "subjects": errors_json(judged.subjects_left_out),
        },
        "control": [row.model_dump() for row in control_rows(judged, study.force_N)],
    }


def rate_json(rate: RateTest) -> dict[str, object]:
    """The comparison of speeds, with what it says of the study's B."""
    return {
        **asdict(rate),
        "effect_interval_N": rate.effect_interval_N,
        "study_effect_N": rate.study_effect_N,
        "excludes_study": rate.excludes_study,
    }


def errors_json(errors: Errors | None) -> dict[str, float | None] | None:
    """The worst errors; null where nothing could be left out."""
    if errors is None:
        return None
    return {
        "max_error_mm": _known(errors.max_error_mm),
        "max_error_percent": _known(errors.max_error_percent),
        "rmse_N": errors.rmse_N,
    }


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def as_csv(study: Study) -> str:
    """One row a given force: measured displacement, then each law's prediction and errors, fitted and left out."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    columns = _columns(study)
    writer.writerow(columns)
    length = max(len(column) for column in columns.values())
    writer.writerows([_text(column, index) for column in columns.values()] for index in range(length))
    return out.getvalue()


def _columns(study: Study) -> dict[str, list[float]]:
    first = rows(next(iter(study.judged.values())).fitted)
    columns = {
        "force_N": [row.force_N for row in first],
        "measured_mm": [row.measured_mm for row in first],
        "measured_spread_mm": [row.measured_spread_mm for row in first],
    }
    for name, judged in study.judged.items():
        fitted = rows(judged.fitted)
        columns[f"{name}_mm"] = [row.predicted_mm for row in fitted]
        for kind, errors in (
            ("", judged.fitted),
            ("_trial_left_out", judged.trials_left_out),
            ("_speed_left_out", judged.speeds_left_out),
            ("_subject_left_out", judged.subjects_left_out),
        ):
            found = rows(errors) if errors else []
            columns[f"{name}_error{kind}_mm"] = [row.error_mm for row in found]
            columns[f"{name}_error{kind}_percent"] = [row.error_percent for row in found]
    return columns


def _text(column: list[float], index: int) -> str:
    return f"{column[index]:.6g}" if index < len(column) and math.isfinite(column[index]) else ""
