"""From a study of tissue laws to its result."""

import math
from collections.abc import Iterator, Mapping

from rig.results.fit import DisplacementErrors, FitResult, HeldOut, LawResult, ParameterResult
from rig.tissue.control_table import control_rows
from rig.tissue.intervals import LEVEL
from rig.tissue.judging import Errors, Judged
from rig.tissue.laws import FloatArray
from rig.tissue.model import HELD_PERCENT, none_to_track_with
from rig.tissue.study import Known, Study, rows
from rig.trials.findings import merge

FRICTION = "friction shows at reversals: curves of loading say nothing for or against it"


def fit_result(study: Study, model: str, model_law: str, known: Known, recordings: Mapping[str, str]) -> FitResult:
    """The study as it is saved; ``model`` is the file that holds ``model_law``, ``recordings`` name and hash."""
    laws = {name: law_result(judged, study.force_N) for name, judged in study.judged.items()}
    return FitResult.model_validate({
        **laws,
        "session": study.session,
        "trials": [curve.name for curve in study.curves],
        "skipped": study.skipped,
        "speeds": study.speeds,
        "force_N": study.force_N.tolist(),
        "closest": study.closest,
        "rate": study.rate,
        "model": model,
        "model_law": model_law,
        "known": known,
        "recordings": recordings,
        "remarks": [*_remarks(laws[model_law], model_law, any(each.law.friction[0] for each in study.judged.values()))],
        "data_quality": merge([finding for curve in study.curves for finding in curve.findings]),
    })  # fmt: skip


def _remarks(law: LawResult, name: str, friction: bool) -> Iterator[str]:
    """What the curves cannot tell, and where the law is none to track with."""
    if friction:
        yield FRICTION
    if law.worst_percent is not None and law.worst_percent > HELD_PERCENT:
        yield none_to_track_with(name, law.worst_percent)


def law_result(judged: Judged, force_N: FloatArray) -> LawResult:
    """A fitted law with its errors, and with what it means to a force loop at each force [N]."""
    left_out = judged.trials_left_out, judged.speeds_left_out, judged.subjects_left_out
    trials, speeds, subjects = (_errors(errors) if errors else None for errors in left_out)
    return LawResult(
        **dict(_errors(judged.fitted)), formula=judged.law.formula, parameters=_parameters(judged),
        interval_level=LEVEL, interval_method=judged.interval_method, control=control_rows(judged, force_N),
        held_out=HeldOut(trials=trials, speeds=speeds, subjects=subjects),
    )  # fmt: skip


def _errors(errors: Errors) -> DisplacementErrors:
    return DisplacementErrors(
        max_error_mm=errors.max_error_mm, max_error_percent=errors.max_error_percent, rmse_N=errors.rmse_N,
        rows=tuple(rows(errors)),
    )  # fmt: skip


def _parameters(judged: Judged) -> dict[str, ParameterResult]:
    return {
        p.name: ParameterResult(
            value=p.value,
            unit=p.unit,
            standard_error=math.sqrt(judged.covariance[i, i]),
            interval=judged.intervals[p.name],
            at_bound=p.name in judged.fit.at_bounds,
            known=p.name in judged.fit.known,
        )
        for i, p in enumerate(judged.law.parameters)
    }
