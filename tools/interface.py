"""The reference of ``import rig``: signature and docstring of everything in its ``__all__``, and of their methods."""

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator
from functools import cached_property
from types import ModuleType

PROPERTIES = (property, cached_property)


def interface(module: ModuleType) -> str:
    """Markdown of what ``module`` offers, in the order of its ``__all__``; texts such as the version are left out."""
    offered = [(name, vars(module).get(name, getattr(module, name))) for name in module.__all__]
    return "\n".join(part for name, thing in offered for part in _parts(f"{module.__name__}.{name}", thing))


def _parts(name: str, thing: object) -> Iterator[str]:
    if inspect.isclass(thing):
        yield f"## class `{name}`\n\n{_said(thing)}\n"
        yield from (_member(*member) for member in vars(thing).items() if not member[0].startswith("_"))
    elif inspect.isfunction(thing):
        yield f"## `{name}{_signature(thing)}`\n\n{_said(thing)}\n"


def _member(name: str, thing: object) -> str:
    if isinstance(thing, PROPERTIES):
        return f"### `{name}`\n\n{_said(thing)}\n"
    return f"### `{name}{_signature(thing)}`\n\n{_said(thing)}\n" if inspect.isfunction(thing) else ""


def _signature(function: Callable[..., object]) -> str:
    """As it is written in the source."""
    (written,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    assert isinstance(written, ast.FunctionDef)
    written.args.args = [one for one in written.args.args if one.arg != "self"]
    return f"({ast.unparse(written.args)}) -> {_type(written.returns)}"


def _type(written: ast.expr | None) -> str:
    """A type that stands in quotes, because it is loaded late, without them."""
    return str(written.value) if isinstance(written, ast.Constant) else ast.unparse(written) if written else ""


def _said(thing: object) -> str:
    return (inspect.getdoc(thing) or "").replace("``", "`")
