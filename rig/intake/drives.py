"""Whether a table that nobody described is of a drive axis alone: joint, set-point and effort, and no force felt."""

from rig.intake.families import ColumnGroup
from rig.intake.measured import chosen
from rig.intake.roles import WORDS, candidates, words_of
from rig.intake.units import FORCE_N

EFFORTS = frozenset(("torque", "drehmoment", "moment", "effort", "tau", "load", "current", "motor"))
# Words and units of a sensor that feels; of a load in percent nobody knows.
FELT = frozenset(WORDS["force"]) - EFFORTS - {"last", "charge", "f"}
JOINTS = frozenset(("q", "joint", "motor", "encoder", "servo", "gelenk"))
WISHES = frozenset(("target", "setpoint", "command", "commanded", "cmd", "desired", "demand", "goal", "soll", "ref"))


def drive_in(table: ColumnGroup) -> str:
    """The doubt that says by which columns; empty of other tables."""
    known, header = chosen(table), table.layout.sheet.header
    said = {number: set(words_of(header[number])) for number in table.columns}
    felt = any(said[number] & FELT or table.unit(number) in FORCE_N for number in table.columns)
    if felt or not {"force", "position"} <= known.keys() or not said[known["force"]] & EFFORTS:
        return ""
    wished = (number for number in said if said[number] & WISHES and candidates("position", [header[number]], [""]))
    joint = [known["position"]] if said[known["position"]] & JOINTS else []
    by = next((header[number] for number in (*wished, *joint)), "")
    taken = f"{table.path.name}: {header[known['force']]!r} and {by!r} are taken for a drive axis without tissue"
    return (
        f"{taken}, which `rig diagnose` judges and `rig fit` refuses; where it presses tissue take axis out"
        if by
        else ""
    )
