"""Patterns with named places, ``{run}/well_{site:[A-H]?}_*.csv``: which files and sheets they name, and what with."""

import re
from collections.abc import Mapping

from rig.errors import UsageError

_PLACE = re.compile(
    r"\{(?P<name>\w+)(?::(?P<shell>[^{}]*))?\}|(?P<folders>\*\*/)|(?P<many>\*)|(?P<one>\?)|\[(?P<of>[^\]/]+)\]"
)

_BRACED = re.compile(r"\{([^{}]*)\}")


def matched(pattern: str | tuple[str, ...], text: str) -> dict[str, str] | None:
    """What stands in each named place, None where ``text`` is of none of the patterns.

    ``*``, ``?``, ``[A-Z]`` and ``**/`` are as in a shell; a place takes anything in one folder, or what the shell
    pattern behind its colon takes. A name that stands twice stands for the same.
    """
    patterns = (pattern,) if isinstance(pattern, str) else pattern
    found = next(filter(None, (re.fullmatch(_expression(item, set()), text) for item in patterns)), None)
    return found.groupdict() if found else None


def _expression(pattern: str, seen: set[str]) -> str:
    parts, end = [], 0
    for place in _PLACE.finditer(pattern):
        parts += [re.escape(pattern[end : place.start()]), _place(place, seen)]
        end = place.end()
    return "".join([*parts, re.escape(pattern[end:])])


def _place(place: re.Match[str], seen: set[str]) -> str:
    if place["of"]:
        return f"[{place['of'].replace('!', '^', 1) if place['of'].startswith('!') else place['of']}]"
    if not place["name"]:
        return "(?:.*/)?" if place["folders"] else "[^/]*" if place["many"] else "[^/]"
    if place["name"] in seen:
        return f"(?P={place['name']})"
    seen.add(place["name"])
    return f"(?P<{place['name']}>{_expression(place['shell'], seen) if place['shell'] else '[^/]+?'})"


def filled(template: str, labels: Mapping[str, str], where: str) -> str:
    """``template`` with each ``{name}`` replaced, and no more than a name; raises UsageError naming those there are."""
    asked = _BRACED.findall(template)
    if unknown := [name for name in asked if name not in labels]:
        known = ", ".join(sorted(labels))
        raise UsageError(f"{where}: {template!r} asks for {unknown[0]!r}; there are {known}")
    if "{" in (rest := _BRACED.sub("", template)) or "}" in rest:
        raise UsageError(f"{where}: {template!r} has a brace that belongs to no name")
    return _BRACED.sub(lambda place: labels[place[1]], template)
