"""The force law and others as they were simulated, in a table."""

from collections.abc import Sequence

from rig.results.tables import TextTable, cells
from rig.results.tracking import AlternativeRun

SHOWN = {"overshoot (%)": "overshoot_percent:.1f", "settling (s)": "settling_s:.2f"}


def alternatives_table(runs: Sequence[AlternativeRun]) -> TextTable:
    """Each law on each subject: worst overshoot and settling on tissue as learnt, and on half and twice that."""
    header = ["subject", "law", *SHOWN, *(f"{what}, wrong model" for what in SHOWN)]
    rows = [[run.subject, run.law, *cells(run.worst, SHOWN), *cells(run.worst_of_wrong, SHOWN)] for run in runs]
    title = "The same jumps simulated, all laws tuned at the same margins; wrong model: tissue half and twice as stiff"
    return TextTable(title, header, rows, words=2)
