"""The simulation with its named causes as a model that the control takes at once."""

import hashlib
from collections.abc import Sequence

import numpy as np

from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.estimates import Estimate, NamedCause
from rig.diagnosis.fit import Fit
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.problem import Effect
from rig.errors import DataError
from rig.tissue.laws_extended import Extended
from rig.tissue.model import Model, ModelCause, Provenance, Quality, UncertainValue, ValidRange
from rig.version import SOFTWARE


def extended_model(result: Diagnosis) -> Model:
    """The final model of a diagnosis of indentations; raises DataError where nothing could be fitted."""
    if result.search is None or not isinstance(result.search.after.problem, IndentationProblem):
        raise DataError(f"{result.session}: nothing was fitted, so there is no extended model")
    fit = result.search.after
    law = Extended.clipped(**{name: fit.values[name] for name in Extended.bounds})
    return Model(
        law=law, covariance=covariance_of(fit),
        intervals={p.name: _interval(result, p.name, p.value) for p in law.parameters}, interval_level=0.95,
        interval_method="joint fit, recordings as units", valid=_valid(fit, law),
        data=_provenance(fit, result.session), quality=_quality(fit, law),
        effects=causes_of(result.findings, fit.problem.effects),
    )  # fmt: skip


def covariance_of(fit: Fit) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Covariance of the law's parameters, shape (p, p); 0 where one was not free. Logarithms are carried through."""
    free = {par.name: k for k, par in enumerate(fit.free)}
    covariance = np.zeros((len(Extended.bounds), len(Extended.bounds)))
    there = [(k, free[name]) for k, name in enumerate(Extended.bounds) if name in free]
    scale = {at: fit.values[fit.free[at].name] if fit.free[at].log else 1.0 for _, at in there}
    for k, one in there:
        for j, other in there:
            covariance[k, j] = fit.covariance[one, other] * scale[one] * scale[other]
    return 0.5 * (covariance + covariance.T)


def _interval(result: Diagnosis, name: str, value: float) -> tuple[float, float]:
    known: dict[str, tuple[float, float]] = {}
    for found in (result.base, *(finding.parameters for finding in result.findings)):
        known |= {key: (float(interval.low), float(interval.high)) for key, interval in found.items()}
    low, high = known.get(name, (value, value))
    return min(low, value), max(high, value)


def _depth_mm(fit: Fit) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    assert isinstance(fit.problem, IndentationProblem)
    return np.asarray(fit.problem.data.drive.position_mm - fit.values["surface_mm"] - fit.values["contact_offset_mm"])


def _valid(fit: Fit, law: Extended) -> ValidRange:
    """As deep as was recorded, and the force the law has there at rest."""
    assert isinstance(fit.problem, IndentationProblem)
    drive = fit.problem.data.drive
    deepest_mm = float(_depth_mm(fit).max())
    if not deepest_mm > 0:
        raise DataError(f"{fit.problem.data.name}: the fitted surface was never reached, so there is no model")
    speeds = np.unique(np.round(drive.speed_mm_s[drive.starts[:-1]]))
    return ValidRange(
        depth_mm=deepest_mm, force_N=float(law.force(deepest_mm)), speeds_mm_s=tuple(map(float, speeds)) or (0.0,)
    )


def _provenance(fit: Fit, session: str) -> Provenance:
    assert isinstance(fit.problem, IndentationProblem)
    data = fit.problem.data
    digest = hashlib.sha256()
    for column in (data.drive.time_s, data.drive.position_mm, data.force_N):
        digest.update(np.ascontiguousarray(column, "<f8").tobytes())
    return Provenance(session=session, trials=data.names, sha256=digest.hexdigest(), software=SOFTWARE)


def _quality(fit: Fit, law: Extended) -> Quality:
    """Errors of force, turned into depth by the tangent; percentages of the deepest depth. Raises where it falls."""
    deepest_mm = float(_depth_mm(fit).max())
    tangent_N_mm = float(law.tangent_stiffness(0.5 * deepest_mm))
    if not tangent_N_mm > 0:
        where = f"at {0.5 * deepest_mm:.3g} mm the fitted force does not rise with depth ({tangent_N_mm:.2g} N/mm)"
        raise DataError(f"{where}, so there is no model to control by; record strokes that begin above the tissue")
    largest_mm = float(np.abs(fit.residual).max() / tangent_N_mm)
    return Quality(
        rmse_N=float(np.sqrt(np.mean(fit.residual**2))),
        max_error_mm=largest_mm,
        max_error_percent=100 * largest_mm / deepest_mm,
    )


def causes_of(findings: Sequence[NamedCause], library: Sequence[Effect]) -> tuple[ModelCause, ...]:
    """What was named, with its sizes and their units, and what the control makes of it."""
    control = {effect.name: effect.control for effect in library}
    return tuple(
        ModelCause(
            name=found.effects[0],
            statement=found.statement,
            parameters={name: _known(size) for name, size in found.parameters.items()},
            used=control[found.effects[0]],
        )
        for found in findings
    )


def _known(size: Estimate) -> UncertainValue:
    assert size.unit is not None, "only files of earlier versions have none"
    return UncertainValue(value=size.value, unit=size.unit, low=float(size.low), high=float(size.high))
