"""Compiled functions kept on disk between processes, also those made at run time by binding other functions to them.

numba's own cache knows a function by its bytecode and by the age of its file: neither tells which functions it was
bound to, and two processes that meet in it can file the code for one signature under another. Here each piece of code
is one file, named after all that it was made from, written whole, and with a digest of its own.
"""

import hashlib
import inspect
import os
import pickle
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, TypeVar, cast

import llvmlite
import numba
import numpy as np
from numba import njit
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

Function = TypeVar("Function", bound=Callable[..., object])
_DIGEST_BYTES = 32
_COMPILERS = f"{sys.version} {numba.__version__} {llvmlite.__version__} {np.__version__}"


def compiled(function: Function, parts: Mapping[str, Callable[..., Any]] | None = None) -> Function:
    """``function`` compiled, its calls to module-level functions named in ``parts`` going to those given.

    ``parts`` are results of this function; the code is kept on disk.
    """
    assert isinstance(function, FunctionType)
    named = {**function.__globals__, **(parts or {})}
    dispatcher: Any = njit(FunctionType(function.__code__, named, function.__name__, function.__defaults__))
    dispatcher.source = source_digest(function, {name: vars(part)["source"] for name, part in (parts or {}).items()})
    dispatcher._cache = KeptCode(dispatcher.source)  # noqa: SLF001 - where `cache=True` puts numba's own
    return cast(Function, dispatcher)


def code_folder() -> Path:
    """Below NUMBA_CACHE_DIR, else XDG_CACHE_HOME, else ~/.cache."""
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser() / "tissue-rig"


def source_digest(function: FunctionType, parts: Mapping[str, str]) -> str:
    """Digest of all that ``function`` is compiled from; ``parts`` are digests of the functions bound to it, by name.

    Of what it names else, a constant counts by its value, a class or function by the file that defines it.
    """
    digest = hashlib.sha256(f"{_COMPILERS} {function.__module__}.{function.__qualname__}".encode())
    digest.update(Path(function.__code__.co_filename).read_bytes())
    digest.update(repr(function.__defaults__).encode())
    for name in sorted(set(_names(function.__code__)) & function.__globals__.keys()):
        digest.update(f"{name}={parts.get(name) or _described(function.__globals__[name])}\n".encode())
    return digest.hexdigest()


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _described(value: object) -> str:
    if isinstance(value, bool | int | float | str):
        return repr(value)
    if isinstance(value, ModuleType) and value.__spec__ and value.__spec__.origin == "built-in":
        return value.__name__
    if isinstance(value, ModuleType | type | FunctionType):
        return hashlib.sha256(Path(inspect.getfile(value)).read_bytes()).hexdigest()
    raise TypeError(f"code that names a {type(value).__name__} cannot be kept: its value may change")


def _signature(kind: Any) -> str:
    """A type as numba names it; of named tuples, which it names by class and types, the fields and where they are."""
    made_by, members = getattr(kind, "instance_class", None), getattr(kind, "types", None)
    if members is None:
        return str(kind)
    fields = f"{made_by.__module__}.{made_by.__qualname__}{made_by._fields}" if made_by else ""
    return f"{type(kind).__name__} {fields}{_signatures(members)}"


def _signatures(kinds: Iterable[object]) -> str:
    return f"({', '.join(map(_signature, kinds))})"


class KeptCode(NullCache):
    """What numba asks for code before it compiles, and gives it to afterwards.

    Code that cannot be read, or is not what was written, counts as not there; a folder that cannot be written keeps
    nothing.
    """

    def __init__(self, source: str) -> None:
        self._source = source

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """The code for arguments of types ``sig``, or None."""
        target_context.refresh()
        try:
            kept = self._path(getattr(sig, "args", sig), target_context.codegen()).read_bytes()
        except OSError:
            return None
        digest, body = kept[:_DIGEST_BYTES], kept[_DIGEST_BYTES:]
        if hashlib.sha256(body).digest() != digest:
            return None
        rebuild: Callable[..., CompileResult] = CompileResult._rebuild  # noqa: SLF001 - as numba's cache does
        return rebuild(target_context, *pickle.loads(body))

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keeps the code ``data`` for arguments of types ``sig``, if no address of this process is in it."""
        if data.library.has_dynamic_globals:
            return
        pickled: Callable[..., bytes] = dumps
        body = pickled(data._reduce())  # noqa: SLF001 - as numba's cache does
        path = self._path(getattr(sig, "args", sig), data.codegen)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            _write_whole(path, hashlib.sha256(body).digest() + body)
        except OSError:
            return

    def _path(self, kinds: Iterable[object], codegen: Any) -> Path:
        made_for = f"{self._source} {_signatures(kinds)} {codegen.magic_tuple()}"
        return code_folder() / "code" / hashlib.sha256(made_for.encode()).hexdigest()


def _write_whole(path: Path, content: bytes) -> None:
    """No reader sees a part of it."""
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
        try:
            file.write(content)
            file.flush()
            Path(file.name).replace(path)
        except OSError:
            Path(file.name).unlink(missing_ok=True)
            raise
