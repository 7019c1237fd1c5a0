"""Every place of a module at which something is mutated, as edits of its syntax tree, always in the same order."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass, replace

from benchmarks.mutation.operators import (
    NONE,
    OPERATORS,
    Enums,
    exchanged,
    instead,
    instead_of_statement,
    is_message,
    is_number,
    is_sentence,
)

LONGEST_NAME = 100


@dataclass(frozen=True)
class Place:
    """Where an edit is: lines from its statement's first to its own, and whether they run when the file is imported."""

    scope: str
    first_line: int
    line: int
    at_import: bool


@dataclass(frozen=True)
class Edit:
    """``new`` in place of what ``field`` (at ``index``, where that is a list) of ``parent`` holds; None removes it."""

    parent: ast.AST
    field: str
    index: int | None
    new: ast.AST | None
    place: Place

    @property
    def old(self) -> ast.AST:
        """What is replaced."""
        held = getattr(self.parent, self.field)
        found: ast.AST = held if self.index is None else held[self.index]
        return found

    def apply(self) -> None:
        """Changes the tree this edit was made for."""
        if self.index is None:
            setattr(self.parent, self.field, self.new)
        elif self.new is not None:
            getattr(self.parent, self.field)[self.index] = self.new
        else:
            # A dictionary keeps its keys and its values in two lists.
            for field in ("keys", "values") if isinstance(self.parent, ast.Dict) else (self.field,):
                del getattr(self.parent, field)[self.index]

    @property
    def name(self) -> str:
        """``before -> after``, of the expression around it where that says more."""
        old, new, shown = self.old, self.new, self.parent
        if isinstance(old, ast.Tuple | ast.List) and isinstance(new, ast.Tuple | ast.List):
            at = next(at for at, (a, b) in enumerate(zip(old.elts, new.elts, strict=True)) if a is not b)
            return f"{ast.unparse(old.elts[at])} -> (exchanged with the next)"
        if new is None and not isinstance(shown, ast.Call):
            return f"{ast.unparse(old)} -> (left out)"
        if new and isinstance(shown, ast.stmt | ast.Module | ast.match_case) and not isinstance(shown, ast.AugAssign):
            return f"{ast.unparse(old)} -> {ast.unparse(new)}"
        return self._around()

    def _around(self) -> str:
        held = getattr(self.parent, self.field)
        before, kept = ast.unparse(self.parent), list(held) if isinstance(held, list) else held
        if len(before) > LONGEST_NAME:
            what = ast.unparse(self.parent.func) if isinstance(self.parent, ast.Call) else ""
            new = _text(self.new) if self.new else "(left out)"
            return f"{what}(.. {_text(self.old)} -> {new} ..)"
        self.apply()
        after = ast.unparse(self.parent)
        setattr(self.parent, self.field, kept)
        return f"{before} -> {after}"


def _text(node: ast.AST) -> str:
    """Operators have no source of their own."""
    return ast.unparse(node) or type(node).__name__


def edits(tree: ast.Module, enums: Enums) -> Iterator[Edit]:
    """Every edit of ``tree``."""
    yield from _Walk(enums).body(tree, "body", Place("", 1, 1, True))


class _Walk:
    """Goes through statements and expressions, knowing the place they stand at."""

    def __init__(self, enums: Enums) -> None:
        self._enums = enums

    def body(self, parent: ast.AST, field: str, place: Place) -> Iterator[Edit]:
        """A list of statements."""
        for index, statement in enumerate(getattr(parent, field)):
            here = replace(place, first_line=statement.lineno, line=statement.lineno)
            yield from self._statement(parent, field, index, statement, here)

    def _statement(self, parent: ast.AST, field: str, index: int, statement: ast.stmt, at: Place) -> Iterator[Edit]:
        match statement:
            case ast.ClassDef():
                yield from self.body(statement, "body", _within(at, statement.name, at.at_import))
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                for defaults in ("defaults", "kw_defaults"):
                    inner = _within(at, statement.name, at.at_import)
                    yield from self._children(statement.args, defaults, getattr(statement.args, defaults), inner)
                yield from self.body(statement, "body", _within(at, statement.name, False))
            case ast.Import() | ast.ImportFrom() | ast.Assert() | ast.Pass() | ast.Global() | ast.Nonlocal():
                return
            case ast.Expr(value=ast.Constant()):
                return
            case ast.Assign(value=ast.BinOp(op=ast.BitOr())) if not at.scope:  # a union of types
                return
            case _:
                yield from (Edit(parent, field, index, new, at) for new in instead_of_statement(statement))
                yield from self._parts(statement, at)

    def _parts(self, statement: ast.stmt, at: Place) -> Iterator[Edit]:
        for name, value in ast.iter_fields(statement):
            if name in ("body", "orelse", "finalbody"):
                yield from self.body(statement, name, at)
            elif name == "annotation":
                yield from self._bounds(statement, value, at)
            elif name in ("target", "targets"):
                yield from self._subscripts(value if isinstance(value, list) else [value], at)
            elif name != "type_comment":
                yield from self._children(statement, name, value, at)

    def _bounds(self, statement: ast.stmt, annotation: ast.expr, at: Place) -> Iterator[Edit]:
        """Of an annotation only the figures in it, under the name of what it is about."""
        named = _within(at, ast.unparse(statement.target), at.at_import) if isinstance(statement, ast.AnnAssign) else at
        found = self._children(statement, "annotation", annotation, named)
        yield from (edit for edit in found if is_number(edit.old))

    def _subscripts(self, targets: list[ast.expr], at: Place) -> Iterator[Edit]:
        """What is assigned to keeps its name; only an index in it may be another."""
        for target in targets:
            if isinstance(target, ast.Subscript):
                yield from self._expression(target, "slice", None, target.slice, at)

    def _children(self, parent: ast.AST, field: str, value: object, at: Place) -> Iterator[Edit]:
        if isinstance(value, ast.AST):
            yield from self._any(parent, field, None, value, at)
        elif isinstance(value, list):
            for index, item in enumerate(value):
                if isinstance(item, ast.AST):
                    yield from self._any(parent, field, index, item, at)

    def _any(self, parent: ast.AST, field: str, index: int | None, node: ast.AST, at: Place) -> Iterator[Edit]:
        match node:
            case ast.expr():
                yield from self._expression(parent, field, index, node, at)
            case ast.match_case():
                here = replace(at, line=node.pattern.lineno)
                yield Edit(parent, field, index, None, here)
                yield from self._children(node, "pattern", node.pattern, here)
                yield from self._children(node, "guard", node.guard, here)
                yield from self.body(node, "body", here)
            case ast.ExceptHandler():
                yield from self.body(node, "body", at)
            case ast.operator() | ast.cmpop() | ast.unaryop() | ast.boolop():
                if type(node) in OPERATORS:
                    yield Edit(parent, field, index, OPERATORS[type(node)](), at)
            case _:
                for name, value in ast.iter_fields(node):
                    yield from self._children(node, name, value, at)

    def _expression(self, parent: ast.AST, field: str, index: int | None, node: ast.expr, at: Place) -> Iterator[Edit]:
        here = replace(at, line=node.lineno)
        yield from (Edit(parent, field, index, new, here) for new in instead(node, self._enums))
        if isinstance(node, ast.JoinedStr):
            yield from self._figures(node, here)
            return
        if isinstance(node, ast.Call):
            yield from _arguments(node, here)
        if isinstance(node, ast.Set) or (not at.scope and isinstance(parent, ast.stmt)):
            yield from _entries(node, here)
            yield from (Edit(parent, field, index, new, here) for new in exchanged(node))
        for name, value in ast.iter_fields(node):
            if name != "ctx":
                yield from self._children(node, name, value, here)

    def _figures(self, text: ast.JoinedStr, at: Place) -> Iterator[Edit]:
        """A sentence's own words and formats stay; a name that is put together is no sentence."""
        for index, part in enumerate(text.values):
            if isinstance(part, ast.FormattedValue):
                yield from self._expression(part, "value", None, part.value, at)
            elif not is_sentence(text):
                yield from self._expression(text, "values", index, part, at)


def _within(at: Place, name: str, at_import: bool) -> Place:
    return replace(at, scope=f"{at.scope}.{name}" if at.scope else name, at_import=at_import)


def _arguments(call: ast.Call, at: Place) -> Iterator[Edit]:
    """Each argument None; each left out that may have a default, which is the last one and those with a name.

    A message to a person is neither, and what is written out has mutants of its own.
    """
    last = len(call.args) - 1
    for index, argument in enumerate(call.args):
        if isinstance(argument, ast.Starred) or is_message(argument):
            continue
        if not isinstance(argument, ast.Constant):
            yield Edit(call, "args", index, NONE, replace(at, line=argument.lineno))
        if index == last > 0:
            yield Edit(call, "args", index, None, replace(at, line=argument.lineno))
    for index, keyword in enumerate(call.keywords):
        if keyword.arg and not is_message(keyword.value):
            here = replace(at, line=keyword.lineno)
            if not isinstance(keyword.value, ast.Constant):
                yield Edit(call, "keywords", index, ast.keyword(keyword.arg, NONE), here)
            yield Edit(call, "keywords", index, None, here)


def _entries(table: ast.expr, at: Place) -> Iterator[Edit]:
    """Each entry of a table left out."""
    field = "values" if isinstance(table, ast.Dict) else "elts"
    held = getattr(table, field, []) if isinstance(table, ast.Tuple | ast.List | ast.Set | ast.Dict) else []
    if len(held) > 1:
        yield from (Edit(table, field, index, None, replace(at, line=entry.lineno)) for index, entry in enumerate(held))
