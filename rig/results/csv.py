"""A fit as one CSV table with a row a given force."""

import csv
import io

from rig.results.fit import FitResult, LawResult


def as_csv(fit: FitResult) -> str:
    """One row a given force: measured displacement, then each law's prediction and errors, fitted and left out."""
    out = io.StringIO()
    columns = _columns(fit)
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    length = max(map(len, columns.values()))
    writer.writerows([_text(column, index) for column in columns.values()] for index in range(length))
    return out.getvalue()


def _columns(fit: FitResult) -> dict[str, list[float | None]]:
    first = next(iter(fit.laws.values())).rows
    columns: dict[str, list[float | None]] = {
        "force_N": [row.force_N for row in first],
        "measured_mm": [row.measured_mm for row in first],
        "measured_spread_mm": [row.measured_spread_mm for row in first],
    }
    for name, law in fit.laws.items():
        columns |= _law_columns(name, law)
    return columns


def _law_columns(name: str, law: LawResult) -> dict[str, list[float | None]]:
    columns: dict[str, list[float | None]] = {f"{name}_mm": [row.predicted_mm for row in law.rows]}
    out = law.held_out
    for kind, errors in (
        ("", law),
        ("_trial_left_out", out.trials),
        ("_speed_left_out", out.speeds),
        ("_subject_left_out", out.subjects),
    ):
        found = errors.rows if errors else ()
        columns[f"{name}_error{kind}_mm"] = [row.error_mm for row in found]
        columns[f"{name}_error{kind}_percent"] = [row.error_percent for row in found]
    return columns


def _text(column: list[float | None], index: int) -> str:
    value = column[index] if index < len(column) else None
    return "" if value is None else f"{value:.6g}"
