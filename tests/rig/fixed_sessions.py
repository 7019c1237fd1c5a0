"""Fixed sessions and their answers: what must not change when the way from file to answer does.

``python -m tests.rig.fixed_sessions OUT`` writes the figures. Of those kept beside this file, change only what a defect
that is mended changes.
"""

import importlib
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from benchmarks.hidden.draw import draw_secret, recorded
from mock_devices.testing import real_data
from mock_devices.testing.made.synthetic import (
    Bench,
    index_force,
    metadata,
    tables,
    with_friction,
    write_made_session,
    write_recording,
)
from rig.config.table import load
from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.estimates import Estimate
from rig.diagnosis.observations import observe
from rig.diagnosis.run import diagnose_session
from rig.intake.mapping import MAPPING_FILE, DataMapping
from rig.intake.session import import_folder
from rig.recording.sessions import open_session
from rig.tissue.judging import Errors, Judged
from rig.tissue.study import Study, study_session
from rig.trials.curves import Curve
from rig.trials.opening import AS_IT_IS, Opening, open_place
from rig.trials.reading import trials_of
from rig.trials.trial import TrialSet
from tests.data import recording
from tests.rig.recording.measured import MARKER_TABLE, turned_tables

FILE = Path(__file__).with_suffix(".json")
PERINEAL = real_data.ROOT / "examples" / "mappings" / "perineal_indentation.toml"
NOW = datetime(2026, 1, 2, 10, 0, tzinfo=UTC)
Figures = Mapping[str, object]


def write_captured(folder: Path) -> Path:
    """Five trials on tissue, one through a guide with friction, one in the air, one with invalid samples, one run."""
    air = Bench(force=index_force(a_N_mm=1e-6, damping_N_s_mm=0.0)).cycle(10.0, 999)
    cycles = Bench(rate_Hz=500.0).cycles(trials=1, speeds_mm_s=(5.0, 10.0, 15.0, 30.0))
    with_guide = Bench(force=with_friction(0.2), rate_Hz=500.0).cycle(10.0, 77)
    write_made_session(folder, [*cycles, with_guide, air], subject={"id": "7", "site": "forearm"})
    spoilt = Bench(rate_Hz=500.0).cycle(20.0, 78)
    streams = tables(spoilt)
    streams["force"]["fz_N"][100:120], streams["force"]["valid"][100:120] = 99.0, 0
    streams["axis"]["position_mm"][300:310], streams["axis"]["valid"][300:310] = 0.0, 0
    write_recording(folder / "trial_078.mcap", streams, metadata(spoilt))
    run = Bench().cycle(10.0, 1)
    write_recording(folder / "track_001.mcap", tables(run), metadata(run) | {"trial": {"kind": "tracking"}})
    return folder


def write_tables(folder: Path) -> Path:
    """Six cycles on a guide with friction as CSV, force counted in tension and position out of the tissue."""
    bench, cycles = recorded(4, draw_secret(np.random.default_rng(11), "friction"), 6)
    folder.mkdir()
    facts = ['recording = "{recording}"\n[session]\nid = "tables"\n']
    for number, (cycle, speed) in enumerate(zip(cycles, bench.speeds, strict=True)):
        trial = folder / f"trial_{number:02d}"
        trial.mkdir()
        stated = f"speed_mm_s = {speed:.9g}\ndepth_mm = 8.0\ntemperature_C = {25 + number}.0\n"
        facts.append(f"[recordings.{trial.name}]\n{stated}")
        _write_csv(trial / "force.csv", ("time_s", "force_N"), (cycle.time_s, -cycle.force_n))
        _write_csv(trial / "axis.csv", ("time_s", "position_mm"), (cycle.axis_time_s, -cycle.axis_mm))
        _write_csv(trial / "marker.csv", ("time_s", "x_mm", "y_mm", "z_mm"), (cycle.frame_time_s, *cycle.marker_mm.T))
    (folder / MAPPING_FILE).write_text("".join(facts) + turned_tables(turned=True) + MARKER_TABLE)
    return folder


def _write_csv(path: Path, header: Sequence[str], columns: Sequence[np.ndarray]) -> None:
    rows = [",".join(map(repr, row)) for row in np.stack(columns, axis=1).tolist()]
    path.write_text("\n".join([",".join(header), *rows]) + "\n")


def captured(folder: Path) -> Figures:
    """Fit and diagnosis of a captured session."""
    session = write_captured(folder / "captured")
    return {"fit": of_study(study_session(open_session(session))), "diagnosis": diagnosed(session)}


def imported(folder: Path) -> Figures:
    """A folder of tables diagnosed as it is, and the session imported from it, fitted and as a diagnosis sees it."""
    source, out = write_tables(folder / "tables"), folder / "imported"
    import_folder(source, load(DataMapping, source / MAPPING_FILE), out, NOW)
    fit = of_study(study_session(open_session(out)))
    return {"tables": diagnosed(source), "fit": fit, "observed": observed(out)}


def measured(_: Path) -> Figures:
    """What the diagnosis sees of real meat, four recordings of a testing machine."""
    return observed(recording("perineal_indentation"), Opening(PERINEAL, "230411_C_Ind*_RDG1[A-D]"))


def diagnosed(folder: Path) -> Figures:
    """What is observed in a folder, and the diagnosis of it."""
    return {**observed(folder), **of_diagnosis(diagnose_session(read(folder)))}


def read(place: Path, opening: Opening = AS_IT_IS) -> TrialSet:
    """The trials of whatever lies there."""
    with tempfile.TemporaryDirectory() as scratch:
        return trials_of(open_place(place, opening, Path(scratch), NOW))


def observed(folder: Path, opening: Opening = AS_IT_IS) -> Figures:
    """Sums over the working grid, and what was said of the data."""
    seen = observe(read(folder, opening))
    drive = seen.drive
    arrays = (drive.time_s, drive.position_mm, drive.velocity_mm_s, seen.force_N, seen.tip_mm, drive.temperature_C)
    return {
        "names": list(seen.names),
        "samples": drive.size,
        "sums": [None if array is None else [float(np.abs(array).sum()), float(array @ array)] for array in arrays],
        "findings": [[finding.recording, finding.stream, finding.kind] for finding in seen.findings],
    }


def of_diagnosis(result: Diagnosis) -> Figures:
    """The diagnosis' figures, without its words."""
    return {
        "verdict": result.verdict,
        "recordings": result.recordings,
        "base": [_interval(found) for found in result.base.values()],
        "detectable": {name: size.minimum for name, size in sorted(result.detectable.items())},
        "named": [
            {
                "causes": list(found.effects),
                "evidence": [found.evidence_nats, found.p_value, found.confidence],
                "parameters": [_interval(size) for size in found.parameters.values()],
                "gain": [*found.gain.errors, found.gain.reduction, found.gain.low, found.gain.high],
            }
            for found in result.findings
        ],
    }


def _interval(found: Estimate) -> list[float]:
    return [found.value, found.low, found.high]


def of_study(study: Study) -> Figures:
    """The fit's figures, without its words."""
    return {
        "curves": {curve.name: of_curve(curve) for curve in study.curves},
        "skipped": [one.trial for one in study.skipped],
        "force_N": study.force_N.tolist(),
        "closest": study.closest,
        "laws": {name: _judged(judged) for name, judged in study.judged.items()},
    }


def of_curve(curve: Curve) -> list[float]:
    """Contact, zero, noise, and sums over the curve."""
    sums = [float(array.sum()) for array in (curve.depth_mm, curve.force_N, curve.rate_mm_s, curve.time_s)]
    return [*curve.contact, curve.zero_N, curve.noise_N, curve.speed_mm_s, len(curve.force_N), *sums]


def _judged(judged: Judged) -> Figures:
    return {
        "values": [parameter.value for parameter in judged.law.parameters],
        "intervals": [list(judged.intervals[parameter.name]) for parameter in judged.law.parameters],
        "offsets_mm": judged.fit.offsets_mm.tolist(),
        "fitted": _errors(judged.fitted),
        "trials_left_out": _errors(judged.trials_left_out),
        "speeds_left_out": _errors(judged.speeds_left_out),
    }


def _errors(errors: Errors | None) -> list[float] | None:
    return [errors.rmse_N, errors.max_error_mm, errors.max_error_percent] if errors else None


SESSIONS = {"captured": captured, "imported": imported, "measured": measured}


def main(out: Path) -> None:
    """Writes the figures of every session that is there, and by which machine's arithmetic they came."""
    with tempfile.TemporaryDirectory() as folder:
        figures = {name: figures_of(Path(folder)) for name, figures_of in SESSIONS.items() if is_there(name)}
    out.write_text(json.dumps({"arithmetic": arithmetic(), **figures}, indent=1) + "\n")


def is_there(name: str) -> bool:
    """Whether the data of a session are on this machine."""
    return name != "measured" or real_data.folder().exists()


def arithmetic() -> list[object]:
    """What the last digits of a fit depend on: processor, and whether numpy uses its widest registers."""
    features: Mapping[str, bool] = importlib.import_module("numpy._core._multiarray_umath").__cpu_features__
    return [platform.machine(), features.get("AVX512_SKX", False)]


def in_one_arithmetic(out: Path) -> dict[str, object]:
    """The figures as a process of its own finds them, whose linear algebra takes no account of the processor."""
    environment = {**os.environ, "OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run([sys.executable, "-m", __spec__.name, str(out)], check=True, env=environment)
    figures: dict[str, object] = json.loads(out.read_text())
    return figures


if __name__ == "__main__":
    main(Path(sys.argv[1]))
