"""Whether a table that nobody described is of a drive axis alone: joint, set-point and effort, and no force felt."""

from rig.intake.families import ColumnGroup
from rig.intake.measured import chosen
from rig.intake.roles import WORDS, candidates, words_of
from rig.intake.units import FORCE_N

EFFORTS = frozenset(("torque", "drehmoment", "moment", "effort", "tau", "current"))
# A servo's effort, and what the cell of a bench feels.
LOADS = frozenset(("load", "last", "charge"))
# Words and units of a sensor that feels.
FELT = (frozenset(WORDS["force"]) | {"cell"}) - EFFORTS - LOADS - {"f"}
JOINTS = frozenset(("q", "servo"))
# People have joints too, and benches for tissue motors and encoders.
MAY_BE_JOINTS = frozenset(("joint", "gelenk", "motor", "encoder"))
WISHES = frozenset(("target", "setpoint", "command", "commanded", "cmd", "desired", "demand", "goal", "soll", "ref"))


def drive_in(table: ColumnGroup) -> tuple[str, bool]:
    """By which columns, empty of other tables, and whether these tell it from a bench that presses tissue."""
    known, header = chosen(table), table.layout.sheet.header
    said = {number: set(words_of(header[number])) for number in table.columns}
    felt = any(said[number] & FELT or table.unit(number) in FORCE_N for number in table.columns)
    if felt or not {"force", "position"} <= known.keys() or not said[known["force"]] & (EFFORTS | LOADS):
        return "", False
    wished = [number for number in said if said[number] & WISHES and candidates("position", [header[number]], [""])]
    place = said[known["position"]]
    by = [*wished, *([known["position"]] if place & (JOINTS | MAY_BE_JOINTS) else [])]
    named = set(words_of(table.path.stem)) & (JOINTS | MAY_BE_JOINTS)  # a file of a motor's has its load
    sure = bool(said[known["force"]] & (EFFORTS | LOADS if named else EFFORTS) and (wished or place & JOINTS))
    return f"{table.path.name}: {header[known['force']]!r} and {header[by[0]]!r}" if by else "", sure
