"""Every text that the program can put together, as it stands in the source: what is filled in is an ellipsis."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("rig", "drivers", "controller", "api", "mock_devices")
GAP = "…"


def texts_in(source: str) -> Iterator[str]:
    """Each string of a module but its docstrings."""
    tree = ast.parse(source)
    said_nowhere = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if id(node) in said_nowhere | inside:
            continue
        if isinstance(node, ast.JoinedStr):
            yield "".join(part.value if _is_text(part) else GAP for part in node.values)  # type: ignore[attr-defined]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def _is_text(part: ast.expr) -> bool:
    return isinstance(part, ast.Constant) and isinstance(part.value, str)


@cache
def every_text() -> tuple[str, ...]:
    """Of all packages."""
    files = (path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py")))
    return tuple(text for path in files for text in texts_in(path.read_text()))


def can_be_said(message: str, texts: tuple[str, ...]) -> bool:
    """Whether one of ``texts`` has all parts of ``message`` between its gaps, in their order."""
    parts = [part.strip() for part in message.split(GAP) if part.strip()]
    return bool(parts) and any(_has_in_order(text, parts) for text in texts)


def _has_in_order(text: str, parts: list[str]) -> bool:
    at = 0
    for part in parts:
        at = text.find(part, at)
        if at < 0:
            return False
        at += len(part)
    return True
