"""A fitted law and what must be known to use it: how sure its parameters are, where it holds, what data it is from."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import numpy as np
from pydantic import Field

from rig.config.table import Table, parse, refuse_newer
from rig.errors import DataError, UsageError
from rig.recording.files import write_text
from rig.tissue.laws import FloatArray, Law
from rig.tissue.registry import law_named
from rig.tissue.summary import ControlRow, NotNegative

FORMAT: Literal["tissue-rig model"] = "tissue-rig model"
VERSION: Literal[2] = 2
# Parameters of version 1 under their names of today; values and units are the same.
RENAMED = {
    "B_N_s_mm": "damping_N_s_mm", "n": "exponent", "n_1": "exponent", "q_per_mm": "quadratic_per_mm",
    "s_per_mm3": "substrate_per_mm3", "r": "relaxation_ratio", "r_1": "relaxation_ratio",
    "c_mm_N": "frame_compliance_mm_N", "stiffening_1_mm": "b_per_mm", "elastic_exponent_1": "exponent",
    "elastic_quadratic_1_mm": "quadratic_per_mm", "substrate_1_mm3": "substrate_per_mm3",
    "rate_exponent_1": "rate_exponent", "relaxation_1": "relaxation_ratio", "relaxation_tau_s": "tau_s",
    "preconditioning_1": "preconditioning_gain", "preconditioning_strokes_1": "preconditioning_cycles",
    "temperature_1_K": "temperature_per_K", "friction_start_1": "friction_start", "gain_error_1": "gain_error",
}  # fmt: skip

BY_PARAMETER = "parameters", "standard_errors", "intervals", "units"
# What a file holds as the model does.
AS_SAVED = "intervals", "interval_level", "interval_method", "valid", "data", "quality", "control", "effects"

# Displacement by half: tissue twice as stiff as the model, the most that the loop's gains are chosen for
# (controller.law.synthesis).
HELD_PERCENT = 50.0

T = TypeVar("T")


class ValidRange(Table):
    """What the fitted data covered; beyond it the law is a guess."""

    depth_mm: Annotated[float, Field(gt=0)]
    force_N: Annotated[float, Field(gt=0)]
    speeds_mm_s: tuple[NotNegative, ...] = Field(min_length=1)


class Provenance(Table):
    """Which data the law was fitted to and by what; ``sha256`` covers the fitted curves themselves."""

    session: str
    trials: tuple[str, ...] = Field(min_length=1)
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    subject: str = ""
    site: str = ""
    software: str = ""


class Quality(Table):
    """How well the law does, on the fitted curves and on trials and speeds left out."""

    rmse_N: NotNegative
    max_error_mm: NotNegative
    max_error_percent: NotNegative
    held_out_max_error_mm: NotNegative | None = None
    held_out_max_error_percent: NotNegative | None = None


class UncertainValue(Table):
    """A value with its unit and 95 % interval."""

    value: float
    unit: str
    low: float
    high: float


class ModelCause(Table):
    """A cause that a diagnosis named in the data; ``used`` says what the control makes of it."""

    name: str
    statement: str
    parameters: dict[str, UncertainValue]
    used: str


class _File(Table):
    """`model.json` as it stands on disk."""

    format: Literal["tissue-rig model"]
    version: Literal[1, 2]
    law: str
    formula: str
    parameters: dict[str, float]
    units: dict[str, str]
    standard_errors: dict[str, NotNegative]
    intervals: dict[str, tuple[float, float]]
    interval_level: Annotated[float, Field(gt=0, lt=1)]
    interval_method: str
    covariance: tuple[tuple[float, ...], ...]
    valid: ValidRange
    data: Provenance
    quality: Quality
    control: tuple[ControlRow, ...] = ()
    effects: tuple[ModelCause, ...] = ()


@dataclass(frozen=True)
class Model:
    """A law fitted to data.

    ``covariance`` has the order of ``law.parameters``; ``intervals`` are per parameter, at ``interval_level``.
    ``control`` says what the law means to a force loop at each given force, for readers without this program;
    ``effects`` what a diagnosis named, be it in the law or not.
    """

    law: Law
    covariance: FloatArray
    intervals: Mapping[str, tuple[float, float]]
    interval_level: float
    interval_method: str
    valid: ValidRange
    data: Provenance
    quality: Quality
    control: tuple[ControlRow, ...] = ()
    effects: tuple[ModelCause, ...] = ()

    @property
    def standard_errors(self) -> dict[str, float]:
        """Square roots of the covariance's diagonal, by parameter."""
        deviations = np.sqrt(np.diag(self.covariance))
        return {p.name: float(s) for p, s in zip(self.law.parameters, deviations, strict=True)}

    @property
    def damping_N_s_mm(self) -> float:
        """Force per speed; of a law whose damping grows with depth, in the middle of the depths fitted."""
        return float(self.law.damping(np.array(self.valid.depth_mm / 2)))

    def force_N(self, depth_mm: float) -> float:
        """Force at rest."""
        return float(self.law.force(depth_mm))

    def tangent_N_mm(self, depth_mm: float) -> float:
        """Stiffness a force loop sees."""
        return float(self.law.tangent_stiffness(depth_mm))

    def depth_mm(self, force_N: float) -> float:
        """Depth at rest at which the force is reached."""
        return float(self.law.depth(force_N))

    def check_force(self, force_N: float) -> None:
        """Raises DataError where the model was not fitted up to this force, or errs more than a loop holds."""
        worst_percent = self.quality.held_out_max_error_percent or self.quality.max_error_percent
        if not worst_percent <= HELD_PERCENT:
            raise DataError(none_to_track_with(self.law.name, worst_percent))
        if not 0 <= force_N <= self.valid.force_N:
            raise DataError(
                f"{force_N:g} N is outside what the model was fitted to, 0 to {self.valid.force_N:.3g} N "
                f"(depth up to {self.valid.depth_mm:.3g} mm): ask for less, or fit a session that goes deeper"
            )

    def save(self, path: str | Path) -> None:
        """Writes `model.json`, whole or not at all."""
        write_text(Path(path), json.dumps(self._file().model_dump(), indent=2) + "\n")

    def _file(self) -> _File:
        pars = self.law.parameters
        return _File(
            format=FORMAT, version=VERSION, law=self.law.name, formula=self.law.formula,
            parameters={par.name: par.value for par in pars}, units={par.name: par.unit for par in pars},
            standard_errors=self.standard_errors, covariance=tuple(tuple(map(float, row)) for row in self.covariance),
            **{name: getattr(self, name) for name in AS_SAVED},
        )  # fmt: skip


def none_to_track_with(law: str, worst_percent: float) -> str:
    """What is said of a law that errs by more than ``HELD_PERCENT``."""
    return (
        f"the {law} law errs by up to {worst_percent:.0f} % of a displacement, and a force loop holds tissue "
        "half to twice as stiff as its model: this is none to track with; `rig diagnose` says what it gets wrong"
    )


def load_model(path: Path) -> Model:
    """The model in ``path``; raises UsageError in one sentence where the file is not one."""
    try:
        values = json.loads(path.read_text())
    except FileNotFoundError as error:
        raise UsageError(f"{path}: no such file; `rig fit SESSION` writes a model.json") from error
    except (OSError, ValueError, RecursionError) as error:
        raise UsageError(f"{path}: cannot be read as JSON: {error}; fit the session again") from error
    if not isinstance(values, dict) or values.get("format") != FORMAT:
        raise UsageError(f"{path}: is not a tissue model (no format {FORMAT!r}); `rig fit SESSION` writes one")
    refuse_newer(values, VERSION, str(path))
    if values.get("version") not in (1, VERSION):
        raise UsageError(f"{path}: states no version of its format, 1 or {VERSION}; fit the session again")
    file = _renamed(parse(_File, values, str(path)))
    try:
        return _model(file)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error


def _renamed(file: _File) -> _File:
    """The file as version 2 has it."""
    if file.version == VERSION:
        return file
    tables = {name: _today(getattr(file, name)) for name in BY_PARAMETER}
    effects = tuple(effect.model_copy(update={"parameters": _today(effect.parameters)}) for effect in file.effects)
    return file.model_copy(update={**tables, "effects": effects, "version": VERSION})


def _today(table: Mapping[str, T]) -> dict[str, T]:
    return {RENAMED.get(name, name): value for name, value in table.items()}


def _model(file: _File) -> Model:
    kind = law_named(file.law)
    file = _completed(file, kind)
    for table in BY_PARAMETER:
        given = getattr(file, table)
        if set(given) != set(kind.bounds):
            raise UsageError(
                f"{table} of the {file.law} law are {', '.join(kind.bounds)}; the file has {', '.join(given) or 'none'}"
            )
    for name, bounds in kind.bounds.items():
        if file.units[name] != bounds.unit:
            raise UsageError(f"{name} must be in {bounds.unit}; the file has it in {file.units[name]!r}")
    return Model(
        law=kind(**file.parameters),
        covariance=_covariance(file, len(kind.bounds)),
        **{name: getattr(file, name) for name in AS_SAVED},
    )


def _completed(file: _File, kind: type[Law]) -> _File:
    """The file with what its law has learnt since it was written, off."""
    off = {name: float(getattr(kind, name)) for name in kind.later if name not in file.parameters}
    size = len(file.covariance) + len(off)
    rows = [(*row, *(0.0 for _ in off)) for row in file.covariance]
    added: dict[str, object] = {
        "parameters": file.parameters | off,
        "units": file.units | {name: kind.bounds[name].unit for name in off},
        "standard_errors": file.standard_errors | dict.fromkeys(off, 0.0),
        "intervals": file.intervals | {name: (value, value) for name, value in off.items()},
        "covariance": (*rows, *((0.0,) * size for _ in off)),
    }
    return file.model_copy(update=added)


def _covariance(file: _File, size: int) -> FloatArray:
    if len(file.covariance) != size or any(len(row) != size for row in file.covariance):
        raise UsageError(f"covariance must be {size} x {size} for the {file.law} law")
    covariance = np.array(file.covariance)
    if not np.allclose(covariance, covariance.T) or np.any(np.diag(covariance) < 0):
        raise UsageError("covariance must be symmetric with a diagonal of at least 0")
    return covariance
