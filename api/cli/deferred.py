"""Modules of the command line of which only what is asked for comes to be: a command's help needs its signature.

Numerics, plotting and HTTP together take seconds to load. The modules themselves import and define as usual; only for
help they are loaded in this way: an import, a function or a constant waits until its name is used.
"""

import __future__

import ast
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import ModuleType

PACKAGE = "api.cli."
# Annotations of other functions than the command wait too.
_FLAGS = __future__.annotations.compiler_flag


class DeferredNames(dict[str, object]):
    """Global names of the module ``path``; a name comes to be when it is first used."""

    def __init__(self, module: ModuleType, body: Sequence[ast.stmt], path: str) -> None:
        super().__init__(vars(module))
        self._path = path
        self._imported = {name: place for part in body for name, place in _imports(part)}
        self._defined: dict[str, list[ast.stmt]] = {}
        for part in body:
            for name in _definitions(part):
                self._defined.setdefault(name, []).append(part)

    def __missing__(self, name: str) -> object:
        if name in self._defined:
            for part in self._defined.pop(name):  # its definition, then what is set on it
                self._define(part)
        else:
            self[name] = _member(*self._imported[name])
        return self[name]

    def get(self, name: str, default: object = None) -> object:
        """As ``[name]``, or ``default``."""
        try:
            return self[name]
        except KeyError:
            return default

    def _define(self, part: ast.stmt) -> None:
        if isinstance(part, ast.ClassDef):
            # A class body looks its names up in a way that nothing can wait for.
            for name in _used_by(part):
                self.get(name)
        exec(compile(ast.Module([part], []), self._path, "exec", _FLAGS, True), self)


class DeferringLoader(SourceFileLoader):
    """Gives a module ``DeferredNames`` instead of running it."""

    def exec_module(self, module: ModuleType) -> None:
        """Nothing is run yet."""
        names = DeferredNames(module, ast.parse(self.get_data(self.path)).body, self.path)

        def found(name: str) -> object:
            try:
                return names[name]
            except KeyError as error:
                raise AttributeError(f"{module.__name__} has no {name}") from error

        vars(module)["__getattr__"] = found


def _member(module: str, attribute: str) -> object:
    """What ``from module import attribute`` gives; without an attribute the module."""
    found = import_module(module)
    if not attribute or hasattr(found, attribute):
        return getattr(found, attribute) if attribute else found
    return import_module(f"{module}.{attribute}")


def _imports(part: ast.stmt) -> Iterator[tuple[str, tuple[str, str]]]:
    """Name, then module and attribute that it stands for."""
    if isinstance(part, ast.ImportFrom):
        yield from ((alias.asname or alias.name, (part.module or "", alias.name)) for alias in part.names)
    elif isinstance(part, ast.Import):
        for alias in part.names:
            whole = alias.name if alias.asname else alias.name.partition(".")[0]
            yield alias.asname or whole, (whole, "")


def _definitions(part: ast.stmt) -> Iterator[str]:
    if isinstance(part, ast.FunctionDef | ast.ClassDef):
        yield part.name
    elif isinstance(part, ast.Assign | ast.AnnAssign):
        targets = part.targets if isinstance(part, ast.Assign) else [part.target]
        yield from (node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name))


def _used_by(part: ast.AST) -> Iterator[str]:
    """Names that are used as soon as the class is defined: not those inside its methods, nor its annotations."""
    if isinstance(part, ast.Name):
        yield part.id
    inner: Iterable[ast.AST | None] = ast.iter_child_nodes(part)
    if isinstance(part, ast.FunctionDef):
        inner = [*part.decorator_list, *part.args.defaults, *part.args.kw_defaults]
    elif isinstance(part, ast.AnnAssign):
        inner = [part.value]
    for node in inner:
        yield from _used_by(node) if node else ()


class _Finder(MetaPathFinder):
    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Modules of PACKAGE with the loader above, no others."""
        spec = PathFinder.find_spec(fullname, path, target) if fullname.startswith(PACKAGE) else None
        if spec and spec.origin and isinstance(spec.loader, SourceFileLoader):
            spec.loader = DeferringLoader(fullname, spec.origin)
        return spec


@contextmanager
def deferred() -> Iterator[None]:
    """Within it, modules of PACKAGE that are not loaded yet are loaded in this way."""
    finder = _Finder()
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)
