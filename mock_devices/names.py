"""A name that is not known is answered with the nearest one that is."""

import difflib
from collections.abc import Iterable

from rig.errors import UsageError


def known(name: str, names: Iterable[str], what: str) -> str:
    """``name`` where it is one of ``names``; raises UsageError naming ``what`` it should be and the nearest one."""
    choices = list(names)
    if name in choices:
        return name
    near = difflib.get_close_matches(name, choices, n=1, cutoff=0.0)
    hint = f"nearest valid {what}: {near[0]}; all: {', '.join(choices)}" if near else f"there is no {what} here"
    raise UsageError(f"unknown {what} {name!r}; {hint}")
