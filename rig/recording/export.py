"""Sessions for other programs: CSV and Parquet folders, one HDF5 or one MAT file. Whole or not at all."""

import json
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow_csv
from numpy.typing import NDArray

from rig.channels import FORCE
from rig.errors import UsageError
from rig.recording.columns import legend, streams_in, units
from rig.recording.files import whole_file, whole_folder, write_text
from rig.recording.sessions import Session, TrialInfo, plain
from rig.recording.tables import arrow_table, compression_N, filled, write_parquet

if TYPE_CHECKING:
    import h5py

Format = Literal["csv", "parquet", "hdf5", "mat"]
MatValue = NDArray[np.generic] | str | float | Mapping[str, "MatValue"]
FORMATS: tuple[Format, ...] = get_args(Format)
COLUMNS_FILE = "columns.csv"
# MATLAB's own limits: names of at most 63 characters, files of version 5 below 2 GiB a variable.
MAT_NAME = 63
MAT_LIMIT = 1 << 31
# Of any length, in UTF-8, as `h5py.string_dtype` describes it.
TEXT = np.dtype("O", metadata={"vlen": str})
COMPRESSED = {"compression": "gzip", "compression_opts": 4, "shuffle": True}


def export(session: Session, format: Format, out: Path) -> Path:
    """Writes every stream that has rows of every trial to ``out``: a folder for csv and parquet, else one file.

    Raises UsageError where ``out`` exists or the format cannot hold the session, WriteFailed where the disk is full.
    """
    if not session.trials:
        raise UsageError(f"{session.place}: no recording to export")
    writers: dict[Format, Callable[[Session, Path], None]] = {
        "csv": _csv,
        "parquet": _parquet,
        "hdf5": _hdf5,
        "mat": _mat,
    }
    writers[format](session, out)
    return out


def _information(session: Session) -> str:
    return json.dumps(plain(asdict(session.info)), indent=2, ensure_ascii=False) + "\n"


def _csv(session: Session, out: Path) -> None:
    """``trial_NAME/STREAM.csv`` and the ``mapping.toml`` by which `rig import` reads them.

    Runs of force tracking stand in folders of their own names, which the import leaves alone: they press to no depth.

    Each table begins with ``time_s`` (capture, host's monotonic clock), force also with ``force_N`` in compression.
    Units and meanings stand in ``columns.csv``, the session's facts in ``session.json``.
    """
    with whole_folder(out) as folder:
        facts = dict(filter(None, (_csv_trial(folder, session, trial) for trial in session.trials)))
        write_text(folder / "mapping.toml", _mapping(session, facts, folder))
        write_text(folder / COLUMNS_FILE, legend(streams_in(session)))
        write_text(folder / "session.json", _information(session))


def _csv_trial(out: Path, session: Session, trial: TrialInfo) -> tuple[str, dict[str, object]] | None:
    """Writes the streams; the folder's name and the facts of what an import takes for a trial."""
    recording = session.recording(trial.name)
    name = trial.name if recording.tracks_force else f"trial_{trial.name.removeprefix('trial_')}"
    (out / name).mkdir()
    for stream, columns in filled(recording):
        table = arrow_table(recording, stream)
        if stream is FORCE:
            table = table.add_column(0, "force_N", pa.array(compression_N(recording)))
        table = table.add_column(0, "time_s", pa.array(np.asarray(columns["capture_ns"]) / 1e9))
        arrow_csv.write_csv(table, out / name / f"{stream.name}.csv")
    surface = recording.metadata.get("calibration", {}).get("surface_mm")
    facts = {"speed_mm_s": trial.speed_mm_s, "depth_mm": trial.depth_mm, "outcome": trial.outcome}
    return None if recording.tracks_force else (name, facts | ({"surface_mm": float(surface)} if surface else {}))


def _mapping(session: Session, facts: Mapping[str, Mapping[str, object]], folder: Path) -> str:
    """How `rig import` reads the streams it knows, and the facts of session and trials."""
    tables = [text for stream, text in _TABLES.items() if any(folder.glob(f"trial_*/{stream}.csv"))]
    stated = {"session": {"id": session.info.id, "subject": session.info.subject}, "recordings": facts}
    return "\n".join(['recording = "{recording}"', _toml(stated), *tables])


_TABLES = {
    stream: f"""[[tables]]
files = "{{recording:trial_*}}/{stream}.csv"
time = {{ column = "capture_ns", unit = "ns" }}
columns = {{ {", ".join(columns)} }}
"""
    for stream, columns in {
        "force": ['force = { column = "force_N", unit = "N" }', 'arrival = { column = "arrival_ns", unit = "ns" }'],
        "axis": [
            'position = { column = "position_mm", unit = "mm" }',
            'arrival = { column = "arrival_ns", unit = "ns" }',
        ],
        "marker": [
            *(f'{axis} = {{ column = "{axis}_mm", unit = "mm" }}' for axis in "xyz"),
            'tool = { column = "tool" }',
        ],
    }.items()
}


def _toml(values: Mapping[str, object], above: str = "") -> str:
    """A TOML table of texts and numbers; lists become texts in JSON, unknown numbers are left out."""
    lines, tables = [], []
    for key, value in values.items():
        if isinstance(value, Mapping):
            place = f"{above}{json.dumps(key)}"
            tables.append(f"\n[{place}]\n{_toml(value, f'{place}.')}")
        elif plain(value) is not None:
            simple = isinstance(value, str | int | float)
            lines.append(
                f"{json.dumps(key)} = {json.dumps(value if simple else json.dumps(value), ensure_ascii=False)}\n"
            )
    return "".join(lines + tables)


def _parquet(session: Session, out: Path) -> None:
    """``TRIAL.STREAM.parquet`` with units in the metadata of each field."""
    with whole_folder(out) as folder:
        for trial in session.trials:
            write_parquet(session.recording(trial.name), folder, trial.name)
        write_text(folder / "session.json", _information(session))


def _hdf5(session: Session, out: Path) -> None:
    """``/TRIAL/STREAM/FIELD`` with attributes ``unit`` and ``meaning``; facts as JSON in attributes of the groups."""
    import h5py  # noqa: PLC0415 - it takes as long to load as a small text to import, which needs none of it

    # In memory first: the HDF5 library crashes the process when the disk is full on close.
    # libver: what is newer cannot be opened by the HDF5 of current Debian, R and Octave.
    with (
        whole_file(out) as scratch,
        h5py.File(scratch, "w", driver="core", backing_store=False, libver=("earliest", "v110")) as file,
    ):
        file.attrs["session"] = _information(session)
        for trial in session.trials:
            _group(file.create_group(trial.name), session, trial)
        file.flush()
        scratch.write_bytes(file.id.get_file_image())


def _group(group: "h5py.Group", session: Session, trial: TrialInfo) -> None:
    recording = session.recording(trial.name)
    group.attrs["metadata"] = json.dumps(recording.metadata)
    group.attrs["speed_mm_s"], group.attrs["depth_mm"] = trial.speed_mm_s, trial.depth_mm
    for stream, table in filled(recording):
        for name, kind in stream.kinds.items():
            stored = {"dtype": TEXT} if kind is str else COMPRESSED
            data = group.create_dataset(f"{stream.name}/{name}", data=table[name].to_numpy(), **stored)
            data.attrs["unit"], data.attrs["meaning"] = stream.units[name]


def _mat(session: Session, out: Path) -> None:
    """One struct a trial (``trial_01.force.fz_N``), ``units.force.fz_N``, and ``session`` as JSON text."""
    import scipy.io  # noqa: PLC0415 - as above

    streams = streams_in(session)
    size = sum(
        stream.dtype.itemsize * trial.samples.get(stream.name, 0) for trial in session.trials for stream in streams
    )
    if size >= MAT_LIMIT:
        raise UsageError(
            f"{out}: {size >> 20} MiB are more than a MAT file holds; export hdf5, which MATLAB also reads"
        )
    content: dict[str, MatValue] = {"session": _information(session), "units": units(streams)}
    for trial in session.trials:
        content[_variable(trial.name, content)] = _struct(session, trial)
    with whole_file(out) as scratch:
        scipy.io.savemat(str(scratch), content, appendmat=False, long_field_names=True, do_compression=True)


def _struct(session: Session, trial: TrialInfo) -> dict[str, MatValue]:
    recording = session.recording(trial.name)
    streams: dict[str, MatValue] = {
        stream.name: {name: table[name].to_numpy().reshape(-1, 1) for name in stream.kinds}
        for stream, table in filled(recording)
    }
    facts: dict[str, MatValue] = {"speed_mm_s": trial.speed_mm_s, "depth_mm": trial.depth_mm, "outcome": trial.outcome}
    return {**streams, **facts, "metadata": json.dumps(recording.metadata)}


def _variable(name: str, taken: Collection[str]) -> str:
    """``name`` as a MATLAB name that is not taken: letters, digits and underscores, a letter first."""
    base = re.sub(r"\W", "_", name, flags=re.ASCII)
    base = (base if base[:1].isalpha() else f"trial_{base}")[: MAT_NAME - 4]
    names = [base, *(f"{base}_{number}" for number in range(2, 1000))]
    return next(item for item in names if item not in taken)
