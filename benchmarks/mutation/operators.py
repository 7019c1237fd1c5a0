"""What stands in a mutant instead of a piece of code: pure functions of one node of the syntax tree.

The operators are those of mutmut 3 (numbers, words, operators, comparisons, calls' arguments, assignments, branches of
a match), with `min`, `max`, `any`, `all` exchanged and calls for their effect left out; and beside them what it passes
over: constants of a module, defaults of a class, properties, entries of tables (each left out, each exchanged with the
next), members of enumerations.

Left out is what no test of behaviour can or should see: docstrings, annotations (but for the bounds in them),
decorators, imports, assertions (they tell the type checker what holds), and texts: a text with a blank in it is a
sentence for a person. What a sentence says in figures is mutated like any other expression.
"""

import ast
import copy
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

Enums = Mapping[str, Sequence[str]]
"""Names of enumerations with the names of their members."""

OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Div,
    ast.Mod: ast.Div, ast.Pow: ast.Mult, ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd, ast.BitXor: ast.BitAnd, ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.And: ast.Or, ast.Or: ast.And, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.UAdd: ast.USub, ast.USub: ast.UAdd,
}  # fmt: skip
METHODS = {
    "lower": "upper", "upper": "lower", "lstrip": "rstrip", "rstrip": "lstrip", "find": "rfind", "rfind": "find",
    "removeprefix": "removesuffix", "removesuffix": "removeprefix", "partition": "rpartition",
    "rpartition": "partition",
}  # fmt: skip
FUNCTIONS = {"min": "max", "max": "min", "any": "all", "all": "any"}
# A number from here on is doubled: 1e9 + 1 would be a change that means nothing.
LARGE = 100
NONE = ast.Constant(None)


def enums_in(tree: ast.Module) -> dict[str, list[str]]:
    """The enumerations a module defines."""
    return {
        node.name: [name.id for item in node.body if isinstance(item, ast.Assign) for name in item.targets
                    if isinstance(name, ast.Name)]
        for node in tree.body
        if isinstance(node, ast.ClassDef) and any(ast.unparse(base).endswith("Enum") for base in node.bases)
    }  # fmt: skip


def instead(node: ast.expr, enums: Enums) -> Iterator[ast.expr]:
    """What an expression is replaced by."""
    match node:
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value) | float(value)):
            yield ast.Constant(2 * value if abs(value) >= LARGE else value + 1)
        case ast.Constant(value=str(value) | bytes(value)) if not is_sentence(node):
            yield from (ast.Constant(other) for other in words(value))
        case ast.UnaryOp(op=ast.Not() | ast.Invert()):
            yield node.operand
        case ast.Lambda(body=ast.Constant(value=None)):
            yield ast.Lambda(node.args, ast.Constant(0))
        case ast.Lambda():
            yield ast.Lambda(node.args, NONE)
        case ast.IfExp():
            yield node.body
            yield node.orelse
        case ast.Call(func=ast.Attribute(value=owner, attr=name)) if name in METHODS:
            yield ast.Call(ast.Attribute(owner, METHODS[name], ast.Load()), node.args, node.keywords)
        case ast.Call(func=ast.Name(id=name)) if name in FUNCTIONS:
            yield ast.Call(ast.Name(FUNCTIONS[name], ast.Load()), node.args, node.keywords)
        case ast.Attribute(value=ast.Name(id=name), attr=member) if member in enums.get(name, ()):
            members = enums[name]
            yield ast.Attribute(node.value, members[(members.index(member) + 1) % len(members)], ast.Load())


def instead_of_statement(statement: ast.stmt) -> Iterator[ast.stmt]:
    """What a whole statement is replaced by: None assigned, a loop left otherwise, a call left out."""
    match statement:
        case ast.Break():
            yield ast.Return(None)
        case ast.Continue():
            yield ast.Break()
        case ast.Expr(value=ast.Call() | ast.Await()):
            yield ast.Pass()
        case ast.AugAssign():
            yield ast.Assign([statement.target], statement.value, lineno=statement.lineno)
        case ast.Assign(value=value) | ast.AnnAssign(value=ast.expr() as value) if not _is_type(statement):
            # What is written out as a number, word or truth value has mutants of its own that say more.
            if not isinstance(value, ast.Constant) or value.value is None:
                changed = copy.copy(statement)
                changed.value = ast.Constant("") if isinstance(value, ast.Constant) else NONE
                yield changed


def _is_type(statement: ast.Assign | ast.AnnAssign) -> bool:
    """An alias of a type is an annotation by another name; the bounds in it are mutated all the same."""
    named = isinstance(statement, ast.AnnAssign) and ast.unparse(statement.annotation).endswith("TypeAlias")
    text = ast.unparse(statement.value) if statement.value else ""
    return named or text.startswith(("Annotated[", "Callable[", "TypeVar(", "Literal["))


def exchanged(table: ast.expr) -> Iterator[ast.expr]:
    """The table with one row exchanged with the next; where rows are mere names, their order says nothing."""
    if not isinstance(table, ast.Tuple | ast.List):
        return
    for at, (one, other) in enumerate(pairwise(table.elts)):
        if isinstance(one, ast.Call | ast.Tuple) and isinstance(other, ast.Call | ast.Tuple):
            changed = copy.copy(table)
            changed.elts = [*table.elts[:at], other, one, *table.elts[at + 2 :]]
            yield changed


def words(value: str | bytes) -> Iterator[str | bytes]:
    """The word with something around it, in small letters, in capitals."""
    around = "XX" if isinstance(value, str) else b"XX"
    others = (around + value + around, value.lower(), value.upper())  # type: ignore[operator]
    yield from (other for other in dict.fromkeys(others) if other != value)


def is_sentence(node: ast.expr) -> bool:
    """Whether a text has a blank in it."""
    match node:
        case ast.Constant(value=str(text)):
            return " " in text.strip()
        case ast.JoinedStr():
            return any(isinstance(part, ast.Constant) and " " in str(part.value) for part in node.values)
    return False


def is_message(node: ast.expr) -> bool:
    """A sentence, or several put together."""
    return is_sentence(node) or (isinstance(node, ast.BinOp) and (is_message(node.left) or is_message(node.right)))


def is_number(node: ast.AST) -> bool:
    """Whether it is a number written out."""
    return isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool)
