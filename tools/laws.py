"""The reference of tissue laws: formula, parameters with units and bounds, and source, from the laws themselves."""

import inspect
from collections.abc import Iterable

from rig.tissue.laws import Law

HEADER = "| parameter | unit | from | to | meaning | taken as |\n|---|---|---|---|---|---|"


def laws(known: Iterable[type[Law]]) -> str:
    """Markdown of each law, in the order given."""
    return "\n".join(_law(law) for law in known)


def _law(law: type[Law]) -> str:
    said = (inspect.getdoc(law) or "").replace("``", "`")
    rows = [
        f"| `{name}` | {'' if unit == '1' else unit} | {lower:g} | {upper:g} | {meaning} | {_taken(law, name)} |"
        for name, (unit, lower, upper, meaning) in law.bounds.items()
    ]
    return "\n".join([f"## `{law.name}`", "", f"`{law.formula}`", "", said, "", HEADER, *rows, ""])


def _taken(law: type[Law], name: str) -> str:
    """What a fit takes for a parameter that it does not fit."""
    return f"{law.known[name]:g}" if name in law.known else ""
