"""The maker's library, loaded when a stream is first opened, with a configuration of its own.

How far it looks for streams is settled once a process: without a file that says otherwise it would ask every computer
of the network segment.
"""

import atexit
import ctypes
import os
import tempfile
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from rig.errors import UsageError

CONFIGURATION = "LSLAPICFG"
# Its log goes to standard error of whoever loads it: only what ends the program.
QUIET = -3
# Twice what a resolver waits between its questions (0.5 s), and the answer's way.
RESOLVE_S = 1.5
_loaded: dict[str, ModuleType] = {}


class ClockCorrection(NamedTuple):
    """What the sender's clock lacks on ours [s], and the most that it may be wrong."""

    offset_s: float
    uncertainty_s: float


def configuration(scope: str) -> str:
    """The library's file: IPv4 alone, and streams found as far as ``scope`` says."""
    return f"[ports]\nIPv6 = disable\n\n[multicast]\nResolveScope = {scope}\n\n[log]\nlevel = {QUIET}\n"


def load(scope: str) -> ModuleType:
    """The library; UsageError where the extra is not installed, or it was loaded with another scope."""
    if scope in _loaded:
        return _loaded[scope]
    if _loaded:
        raise UsageError(f"input scope {scope}: another input has scope {next(iter(_loaded))}; one program has one")
    if CONFIGURATION not in os.environ:
        os.environ[CONFIGURATION] = str(_file(configuration(scope)))
    try:
        pylsl = import_module("pylsl")
    except (ImportError, RuntimeError) as error:
        raise UsageError(f"product lsl-stream needs an extra: pip install 'tissue-rig[lsl]' ({error})") from error
    return _loaded.setdefault(scope, pylsl)


def streams_there(scope: str = "machine", wait_s: float = RESOLVE_S) -> list[tuple[str, str]]:
    """Name and kind of each stream of numbers that is announced within ``scope``."""
    pylsl = load(scope)
    numbers = (info for info in pylsl.resolve_streams(wait_s) if info.channel_format() != pylsl.cf_string)
    return sorted({(info.name(), info.type()) for info in numbers})


def _file(text: str) -> Path:
    handle, name = tempfile.mkstemp(prefix="tissue-rig-lsl-", suffix=".cfg")
    with os.fdopen(handle, "w") as file:
        file.write(text)
    path = Path(name)
    atexit.register(path.unlink, missing_ok=True)
    return path


def correction(pylsl: ModuleType, inlet: Any, timeout_s: float) -> ClockCorrection:
    """As the library knows it now; raises its TimeoutError where it does not know it in time."""
    ask = pylsl.lib.lib.lsl_time_correction_ex
    ask.restype = ctypes.c_double
    remote_s, uncertainty_s, code = ctypes.c_double(), ctypes.c_double(), ctypes.c_int()
    offset_s = ask(
        inlet.obj, ctypes.byref(remote_s), ctypes.byref(uncertainty_s), ctypes.c_double(timeout_s), ctypes.byref(code)
    )
    pylsl.util.handle_error(code)
    return ClockCorrection(float(offset_s), uncertainty_s.value)
