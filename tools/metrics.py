"""``python -m tools.metrics``: how the source is built, each number beside its goal; the last line is one JSON object.

It ends with 1 where a number that had reached its goal has left it, or `source_lines` passes ``MOST_LINES``.

Source are the five packages; their lines are counted without what is there for safety alone (``SAFETY`` of
`tools.counted_apart`), or came since for data of other laboratories (``DATA``) and to judge the criticism on them
(``CRITICISM``): these are counted apart. Tests are `tests` and what they are made with (`mock_devices.testing`,
`benchmarks.hidden`). An untyped dictionary is a ``dict`` or ``Mapping`` to Any or object in a public signature or
field that another package imports. A threshold is a number with a name at the head of a module that something is
compared with or bounded by, or whose name says it bounds (`LARGEST`, `TIMEOUT`); its reason is a comment on its line,
above it or above a pair of which it is the second, or a text below it.
"""

import ast
import json
import re
import statistics
import sys
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import grimp
from rich.console import Console
from rich.table import Table

from tools.counted_apart import APART

ROOT = Path(__file__).parents[1]
PACKAGES = ("rig", "drivers", "controller", "api", "mock_devices")
HARNESS = "mock_devices/testing/"
TESTS = ("tests", "benchmarks/hidden")
LINES_BEFORE = 30_632  # of the five packages at commit 2887b84
MOST_LINES = 35_910  # what there were on 29 November 2026, rounded up: more must first be saved elsewhere
GOALS = {
    "class_names_twice": ("at most", 0),
    "untyped_dicts": ("at most", 9),
    "upward_imports": ("at most", 0),
    "cycles": ("at most", 0),
    "source_lines": ("at most", 0.9 * LINES_BEFORE),
    "source_lines_safety": ("at most", 8220),
    "source_lines_data": ("at most", 8585),
    "source_lines_criticism": ("at most", 2410),
    "source_lines_service": ("at most", 10295),
    "source_lines_devices": ("at most", 10935),
    "source_lines_law": ("at most", 2235),
    "source_lines_scale": ("at most", 2500),
    "function_median": ("at most", 6),
    "function_p90": ("at most", 20),
    "file_max": ("at most", 400),
    "test_to_source": ("at least", 0.8),
    "thresholds_with_reason": ("at least", 0.9),
}
_UNTYPED = re.compile(r"\b(dict|Mapping|MutableMapping)\[str, (typing\.)?(Any|object)\]")
_BOUNDING = {"min", "max", "clip", "minimum", "maximum"}
_EXTREMES = "LEAST|MOST|LARGEST|SMALLEST|LONGEST|SHORTEST|FEWEST|HIGHEST|LOWEST|DEEPEST|MAX|MIN"
_BOUND = re.compile(rf"(^|_)({_EXTREMES}|LIMIT|MARGIN|TIMEOUT)(_|$)")
_CONSTANT = re.compile(r"_?[A-Z][A-Z0-9]*(_\w+)*")  # a unit after the name may have small letters
Functions = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Source:
    """One file, by its path below the root."""

    path: str
    text: str

    @cached_property
    def tree(self) -> ast.Module:
        """Its syntax."""
        return ast.parse(self.text)

    @cached_property
    def lines(self) -> list[str]:
        """Its lines."""
        return self.text.splitlines()

    @property
    def module(self) -> str:
        """Its dotted name."""
        return self.path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")

    @property
    def package(self) -> str:
        """The folder it is in, two levels deep at most: what another package is."""
        return ".".join(self.path.split("/")[:-1][:2])

    def nodes(self, *kinds: type[ast.AST]) -> Iterator[ast.AST]:
        """All nodes of these kinds."""
        return (node for node in ast.walk(self.tree) if isinstance(node, kinds))


def read(root: Path, folders: Iterable[str]) -> list[Source]:
    """All Python files below ``folders``."""
    paths = sorted(path for folder in folders for path in (root / folder).rglob("*.py"))
    return [Source(str(path.relative_to(root)), path.read_text()) for path in paths]


def lines_of(sources: Iterable[Source]) -> int:
    """Physical lines."""
    return sum(len(source.lines) for source in sources)


def is_apart(path: str) -> bool:
    """Whether a file's lines are counted under another name than `source_lines`."""
    return path.startswith(tuple(entry for entries in APART.values() for entry in entries))


def class_names_twice(sources: Iterable[Source], glossary: str = "") -> list[str]:
    """Class names with two definitions or more; those that the glossary gives a reason for, as `Name` (class), not."""
    names = Counter(getattr(node, "name", "") for source in sources for node in source.nodes(ast.ClassDef))
    explained = set(re.findall(r"^`(\w+)` \(class\)", glossary, re.MULTILINE))
    return sorted(name for name, count in names.items() if count > 1 and name not in explained)


def function_lengths(sources: Iterable[Source]) -> list[int]:
    """Lines of each function, from ``def`` to its end, sorted."""
    found = (node for source in sources for node in source.nodes(ast.FunctionDef, ast.AsyncFunctionDef))
    return sorted(
        node.end_lineno - node.lineno + 1 for node in found if isinstance(node, Functions) and node.end_lineno
    )


def untyped_dicts(sources: list[Source]) -> list[str]:
    """Public signatures and fields with an untyped dictionary that another package imports, as module:name."""
    used = {(name, source.package) for source in sources for name in _imported(source)}
    users: dict[str, set[str]] = {}
    for name, package in used:
        users.setdefault(name, set()).add(package)
    return sorted(
        f"{source.module}:{name}"
        for source in sources
        for top, name in _untyped(source.tree)
        if (users.get(f"{source.module}.{top}", set()) | users.get(f"{source.module}.*", set())) - {source.package}
    )


def _imported(source: Source) -> Iterator[str]:
    """Dotted names this file takes from elsewhere; of a module imported whole, the names read from it."""
    aliases: dict[str, str] = {}
    for node in source.nodes(ast.ImportFrom):
        assert isinstance(node, ast.ImportFrom)
        for name in node.names:
            aliases[name.asname or name.name] = f"{node.module}.{name.name}"
    yield from aliases.values()
    for node in source.nodes(ast.Attribute):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in aliases:
            yield f"{aliases[node.value.id]}.{node.attr}"


def _untyped(body: ast.AST, top: str = "", inside: str = "") -> Iterator[tuple[str, str]]:
    """Top-level name and full name of each public definition with an untyped dictionary in it."""
    for node in ast.iter_child_nodes(body):
        name = _named(node)
        if name.startswith("_") and name != "__init__":
            continue
        full = f"{inside}.{name}".strip(".")
        if any(_UNTYPED.search(ast.unparse(shown)) for shown in _annotations(node)):
            yield top or name, full
        if isinstance(node, ast.ClassDef):
            yield from _untyped(node, top or name, full)


def _named(node: ast.AST) -> str:
    if isinstance(node, ast.AnnAssign):
        return ast.unparse(node.target)
    return str(getattr(node, "name", ""))


def _annotations(node: ast.AST) -> list[ast.expr]:
    if isinstance(node, ast.AnnAssign):
        return [node.annotation]
    if not isinstance(node, Functions):
        return []
    kinds = node.args
    taken = [*kinds.posonlyargs, *kinds.args, *kinds.kwonlyargs, kinds.vararg, kinds.kwarg]
    return [found for found in (*(one.annotation for one in taken if one), node.returns) if found]


def upward_imports(graph: grimp.ImportGraph, contracts: Iterable[dict[str, list[str] | str]]) -> list[str]:
    """Imports from a lower layer of an import contract to a higher one, as lower -> higher."""
    found = []
    for contract in contracts:
        for container in contract.get("containers", [""]):
            ranks = _ranks(str(container), contract.get("layers", []))
            found += [
                f"{lower} -> {higher}"
                for lower in sorted(graph.modules)
                for higher in sorted(graph.find_modules_directly_imported_by(lower))
                if (_rank(higher, ranks) or 0) > (_rank(lower, ranks) or len(ranks) + 1)
            ]
    return found


def _ranks(container: str, layers: Iterable[str]) -> dict[str, int]:
    """Rank of each package, 1 for the lowest layer; layers are given highest first."""
    ordered = list(layers)[::-1]
    names = [(name.strip(), rank) for rank, layer in enumerate(ordered, 1) for name in re.split(r"[|:]", layer)]
    return {f"{container}.{name}".strip("."): rank for name, rank in names}


def _rank(module: str, ranks: dict[str, int]) -> int | None:
    return next((rank for name, rank in ranks.items() if f"{module}.".startswith(f"{name}.")), None)


def cycles(graph: grimp.ImportGraph) -> list[list[str]]:
    """Modules that import one another, directly or not: each group once."""
    found: list[list[str]] = []
    for module in sorted(graph.modules):
        if any(module in group for group in found):
            continue
        group = graph.find_upstream_modules(module) & graph.find_downstream_modules(module)
        if group:
            found.append(sorted({module, *group}))
    return found


def thresholds(sources: list[Source]) -> dict[str, bool]:
    """Each threshold as module:name, and whether a reason stands beside it."""
    bounding = {name for source in sources for name in _bounding_names(source)}
    return {
        f"{source.module}:{name}": _has_reason(source, node)
        for source in sources
        for node in source.tree.body
        for name in _constants(node)
        if name in bounding or _BOUND.search(name)
    }


def _constants(node: ast.stmt) -> list[str]:
    """Names of numbers assigned here, one by one or as many numbers to as many names."""
    if isinstance(node, ast.Assign):
        target, value = node.targets[-1], node.value
    elif isinstance(node, ast.AnnAssign) and node.value:
        target, value = node.target, node.value
    else:
        return []
    several = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
    names, numbers = (target.elts, value.elts) if several else ([target], [value])  # type: ignore[attr-defined]
    found = [one.id for one in names if isinstance(one, ast.Name) and _CONSTANT.fullmatch(one.id)]
    return found if all(map(_is_number, numbers)) else []


def _is_number(value: ast.expr) -> bool:
    if isinstance(value, ast.UnaryOp):
        return _is_number(value.operand)
    if isinstance(value, ast.BinOp):
        return _is_number(value.left) and _is_number(value.right)
    return isinstance(value, ast.Constant) and type(value.value) in (int, float)


def _bounding_names(source: Source) -> Iterator[str]:
    for node in source.nodes(ast.Compare, ast.Call):
        if (
            isinstance(node, ast.Compare)
            and any(isinstance(op, ast.Lt | ast.LtE | ast.Gt | ast.GtE) for op in node.ops)
        ) or (isinstance(node, ast.Call) and _called(node) in _BOUNDING):
            yield from _upper_names(node)


def _called(node: ast.Call) -> str:
    return ast.unparse(node.func).rpartition(".")[2]


def _upper_names(node: ast.AST) -> Iterator[str]:
    for one in ast.walk(node):
        name = one.id if isinstance(one, ast.Name) else one.attr if isinstance(one, ast.Attribute) else ""
        if _CONSTANT.fullmatch(name):
            yield name


def _has_reason(source: Source, node: ast.stmt) -> bool:
    """A comment on its lines, right above it, above the one line before it, or a text right below.

    Of a longer group nobody can tell which member a comment above speaks of.
    """
    own = source.lines[node.lineno - 1 : node.end_lineno]
    below = source.lines[node.end_lineno : (node.end_lineno or 0) + 1]
    if any("  # " in line for line in own) or any(line.startswith('"""') for line in below):
        return True
    above, before, *_ = [*reversed(source.lines[: node.lineno - 1]), "", ""]
    paired = re.match(r"_?[A-Z]", above) and "  # " not in above
    return above.startswith("#") or bool(paired and before.startswith("#"))


def measured(root: Path) -> tuple[dict[str, float], dict[str, list[str]]]:
    """The numbers, and what is behind those that are counts."""
    everything = read(root, PACKAGES)
    sources = [source for source in everything if not source.path.startswith(HARNESS)]
    tests = [*read(root, TESTS), *(source for source in everything if source.path.startswith(HARNESS))]
    contracts = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    graph = grimp.build_graph(*PACKAGES, cache_dir=None, exclude_type_checking_imports=True)
    lengths, reasons = function_lengths(sources), thresholds(sources)
    lists = {
        "class_names_twice": class_names_twice(sources, (root / "docs/reference/glossary.md").read_text()),
        "untyped_dicts": untyped_dicts(sources),
        "upward_imports": upward_imports(graph, [one for one in contracts if one["type"] == "layers"]),
        "cycles": [" <-> ".join(group) for group in cycles(graph)],
        "thresholds_without_reason": sorted(name for name, has in reasons.items() if not has),
    }
    numbers = {
        **{name: len(lists[name]) for name in ("class_names_twice", "untyped_dicts", "upward_imports", "cycles")},
        "source_lines": lines_of(source for source in sources if not is_apart(source.path)),
        **{
            name: lines_of(source for source in sources if source.path.startswith(tuple(entries)))
            for name, entries in APART.items()
        },
        "function_median": statistics.median(lengths),
        "function_p90": lengths[round(0.9 * (len(lengths) - 1))],
        "file_max": max(len(source.lines) for source in everything),
        "test_to_source": round(lines_of(tests) / lines_of(sources), 3),
        "thresholds_with_reason": round(sum(reasons.values()) / max(len(reasons), 1), 3),
    }
    return numbers, lists


def reached(name: str, value: float) -> bool:
    """Whether the goal is."""
    side, goal = GOALS[name]
    return value <= goal if side == "at most" else value >= goal


def fallen(numbers: Mapping[str, float]) -> list[str]:
    """Names of the numbers beyond their goal; `source_lines`, which is not there yet, beyond ``MOST_LINES``."""
    return [
        name
        for name, value in numbers.items()
        if not (value <= MOST_LINES if name == "source_lines" else reached(name, value))
    ]


def main() -> None:
    """Prints table, lists where asked by ``--list``, and one line of JSON; ends with 1 where a number fell back."""
    numbers, lists = measured(ROOT)
    console = Console(soft_wrap=True)
    table = Table("what", "value", "goal", "reached")
    for name, value in numbers.items():
        side, goal = GOALS[name]
        table.add_row(name, f"{value:g}", f"{side} {goal:g}", "yes" if reached(name, value) else "no")
    console.print(table)
    if "--list" in sys.argv:
        for name, found in lists.items():
            console.print(f"{name}:", *found, sep="\n  ")
    sys.stdout.write(json.dumps(numbers) + "\n")
    sys.exit(1 if fallen(numbers) else 0)


if __name__ == "__main__":
    main()
