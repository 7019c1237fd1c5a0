"""Where a new calibration is kept, and what keeps it from being."""

from datetime import UTC, datetime
from pathlib import Path

from rig.config.calibration import AnyCalibration, Calibration, What, what_of
from rig.config.calibration_files import text_of
from rig.config.glove import GloveCalibration
from rig.errors import CheckFailed, UsageError
from rig.recording.files import make_folder, refuse_unwritable, whole_file
from rig.results.bench import CalibrateResult

FOLDER = Path("calibration")


def refuse_out(out: Path | None) -> None:
    """Raises, before anybody is asked to do anything, where the calibration could not be written."""
    if out and out.exists():
        raise UsageError(f"{out}: exists already; calibrations are never overwritten, give --out another name")
    refuse_unwritable(out or FOLDER / "new.json")


def refuse_unfit(stated: Calibration, found: AnyCalibration, now: datetime) -> None:
    """Raises CheckFailed where the new calibration is not as good as the wiring states: it would be refused at use."""
    if reasons := stated.alone(found).unfit(now):
        raise CheckFailed("; ".join(reasons))


def kept(stated: Calibration, found: AnyCalibration, out: Path | None) -> CalibrateResult:
    """``found`` in a file, as ``keep``; raises as ``refuse_unfit``, and then nothing is written."""
    refuse_unfit(stated, found, datetime.now(UTC))
    return CalibrateResult(file=str(keep(what_of(found), found, out)), calibration=found)


def keep(what: What, found: AnyCalibration, out: Path | None) -> Path:
    """Writes it, whole or not at all, to ``out`` or calibration/WHAT-SERIAL-TIME.json; returns the path."""
    return _written(out or FOLDER / f"{what}-{_plain(found.serial)}-{_stamp(found.date)}.json", found)


def keep_glove(found: GloveCalibration, out: Path | None) -> Path:
    """Likewise that of a glove, which has no serial number."""
    return _written(out or FOLDER / f"glove-{_stamp(found.date)}.json", found)


def _written(path: Path, found: AnyCalibration | GloveCalibration) -> Path:
    make_folder(path.parent)
    with whole_file(path) as scratch:
        scratch.write_text(text_of(found), encoding="utf-8")
    return path


def _plain(serial: str) -> str:
    """A serial number as part of a file's name."""
    return "".join(letter if letter.isalnum() else "-" for letter in serial) or "unnumbered"


def _stamp(date: datetime) -> str:
    return f"{date:%Y%m%dT%H%M%SZ}"
