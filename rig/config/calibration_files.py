"""Calibration files: JSON or TOML, read whole and checked, written whole or not at all."""

import json
from pathlib import Path

from rig.config.axis_dynamics import AxisDynamics
from rig.config.calibration import KINDS, VERSION, AnyCalibration, AxisCalibration, Calibration, ForceCalibration
from rig.config.glove import GloveCalibration
from rig.config.table import AnyTable, TomlTable, parse, read_toml, refuse_newer
from rig.errors import UsageError


def with_files(calibration: Calibration) -> Calibration:
    """``calibration`` with what its files hold; raises UsageError naming file and key where one is malformed."""
    files = zip(KINDS.items(), (calibration.force, calibration.axis, calibration.dynamics), strict=True)
    found = {f"of_{what}": _read(kind, file, f"calibration.{what}") for (what, kind), file in files if file}
    return calibration.model_copy(update=found)


def text_of(calibration: AnyCalibration | GloveCalibration) -> str:
    """What a calibration file holds."""
    return calibration.model_dump_json(indent=2) + "\n"


def read_force(path: Path) -> ForceCalibration:
    """The force calibration in ``path``; raises UsageError."""
    return _read(ForceCalibration, path, "force calibration")


def read_axis(path: Path) -> AxisCalibration:
    """The axis calibration in ``path``; raises UsageError."""
    return _read(AxisCalibration, path, "axis calibration")


def read_glove(path: Path, role: str) -> GloveCalibration:
    """The calibration of a glove in ``path``; raises UsageError."""
    return _read(GloveCalibration, path, role)


def read_dynamics(path: Path) -> AxisDynamics:
    """The axis' dynamics in ``path``; raises UsageError."""
    return _read(AxisDynamics, path, "axis dynamics")


def _read(kind: type[AnyTable], path: Path, role: str) -> AnyTable:
    values = read_toml(path) if path.suffix == ".toml" else _read_json(path, role)
    refuse_newer(values, VERSION, f"{role} {path}")
    return parse(kind, values, f"{role} {path}")


def _read_json(path: Path, role: str) -> TomlTable:
    try:
        values = json.loads(path.read_text())
    except FileNotFoundError as error:
        raise UsageError(f"{role} {path}: no such file; run `rig calibrate`, or correct the path") from error
    except (OSError, ValueError, RecursionError) as error:
        raise UsageError(f"{role} {path}: cannot be read as JSON: {error}; calibrate again") from error
    if not isinstance(values, dict):
        raise UsageError(f"{role} {path}: holds no calibration; calibrate again")
    return values
