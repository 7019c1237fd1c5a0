"""The reference of causes: what each says, what to do about it, and its parameters, from their declarations."""

import re
from collections import Counter
from collections.abc import Collection

from rig.diagnosis.effects.axis import AxisEffect
from rig.diagnosis.problem import Effect, Par

HEADER = "| parameter | unit | absent at | from | to | smallest named | meaning |\n|---|---|---|---|---|---|---|"
VALUE = re.compile(r"\{(\w+)[^}]*\}")


def causes(known: Collection[Effect]) -> str:
    """Markdown of each cause, in the order given; variants of one cause are told apart by their first parameter."""
    variants = Counter(cause.name for cause in known)
    return "\n".join(_cause(cause, f" ({cause.key})" if variants[cause.name] > 1 else "") for cause in known)


def _cause(cause: Effect, variant: str) -> str:
    needs = [f"- needs: {', '.join(sorted(cause.needs))}"] if cause.needs else []
    repair = [f"- what to do: {cause.repair}"] if cause.repair else []
    return "\n".join(
        [
            f"## `{cause.name}`{variant}",
            "",
            f"{_said(cause.statement)}.",
            "",
            *repair,
            f"- acts: {_place(cause)}",
            f"- in control: {cause.control}",
            *needs,
            "",
            HEADER,
            *(_row(par) for par in cause.pars),
            "",
        ]
    )


def _place(cause: Effect) -> str:
    if isinstance(cause, AxisEffect):
        return "between drive and load" if cause.on_load else "on the effort"
    return f"at `{cause.operator.stage}`" if cause.operator else "in the elastic law"


def _said(statement: str) -> str:
    """A statement with the names of its values in their places."""
    text = VALUE.sub(r"`\1`", statement)
    return text[0].upper() + text[1:]


def _row(par: Par) -> str:
    unit, least = "" if par.unit == "1" else par.unit, f"{par.least:g}" if par.least else ""
    return f"| `{par.name}` | {unit} | {par.null:g} | {par.low:g} | {par.high:g} | {least} | {par.meaning} |"
