"""Help is what the loaded command says, and loads none of what makes commands slow to start."""

import json
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import api.cli
from api.cli.app import COMMANDS
from api.cli.deferred import deferred

HEAVY = {
    "numba",
    "scipy",
    "matplotlib",
    "fastapi",
    "pydantic",
    "h5py",
    "pyarrow",
    "numpy",
    "sqlalchemy",
    "uvicorn",
    "can",
    "control",
}
ASKED = """
import contextlib, io, json, sys
import api.cli.app
from api.cli.deferred import deferred

def helped(name, for_help):
    sys.argv = ["rig", name, "--help"]
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
        if for_help:
            api.cli.app.main()
        else:
            api.cli.app.build(name)()
    return out.getvalue()

names = sys.argv[1:]
found = {name: helped(name, True) for name in names}
modules = sorted({module.partition(".")[0] for module in sys.modules})
for module in [module for module in sys.modules if module.startswith("api.cli.") and module != "api.cli.app"]:
    del sys.modules[module]
print(json.dumps([found, {name: helped(name, False) for name in names}, modules]))
"""


def asked(*names: str) -> tuple[dict[str, str], dict[str, str], set[str]]:
    """Help without and with the whole command loaded, and what the first of them loaded."""
    out = subprocess.run([sys.executable, "-c", ASKED, *names], capture_output=True, text=True, check=True).stdout
    quick, whole, modules = json.loads(out)
    return quick, whole, set(modules)


def test_help_of_all_commands_loads_nothing_heavy_and_says_the_same_as_the_commands_themselves() -> None:
    # That of `rig devices` lists the products with their keys, which the models of their tables say.
    devices, same, of_devices = asked("devices")
    assert of_devices & HEAVY <= {"pydantic"} and devices == same
    quick, whole, modules = asked(*(name for name in COMMANDS if name != "devices"))
    assert modules & HEAVY == set()
    assert {"typer", "api"} <= modules
    assert quick == whole
    assert all("Usage: rig" in text for text in quick.values())


# Half a second each, on a bench that somebody waits for.
SLOW = {"scipy.signal", "scipy.stats", "matplotlib", "numba", "pandas"}


@pytest.mark.parametrize("module", ["api.http.app", "controller.loop.process"])
def test_service_and_loop_start_without_what_a_diagnosis_loads(module: str) -> None:
    command = [sys.executable, "-c", f"import sys, {module}; print(*sys.modules)"]
    loaded = set(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())
    assert module in loaded and loaded & SLOW == set()


MODULE = """
import json
import no_such_module
from no_such_module import thing
from os import path as place
UNUSED = thing.here
WORD, OTHER = "a", "b"


class Choice:
    kind = WORD
    def __init__(self, at: thing = json) -> None:
        self.at = at


def command(a: int = len(OTHER), b: thing = None) -> str:
    return place.join(WORD, Choice().kind)


def other(a: thing = thing.there) -> None: ...
"""


@pytest.fixture
def loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """A command module of that text, loaded for help."""
    (tmp_path / "tried.py").write_text(MODULE)
    monkeypatch.setattr(api.cli, "__path__", [str(tmp_path)])
    with deferred():
        module = import_module("api.cli.tried")
    monkeypatch.delitem(sys.modules, "api.cli.tried")
    return module


def test_what_nobody_asks_for_is_neither_imported_nor_defined(loaded: ModuleType) -> None:
    assert vars(loaded).keys() & {"command", "thing", "no_such_module"} == set()
    assert loaded.command.__defaults__ == (1, None)
    assert loaded.command() == "a/a"


def test_what_is_asked_for_and_not_there_fails_as_it_would_otherwise(loaded: ModuleType) -> None:
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        loaded.other  # noqa: B018
    with pytest.raises(AttributeError, match="has no nothing"):
        loaded.nothing  # noqa: B018


def test_a_command_that_is_run_is_loaded_whole(tmp_path: Path) -> None:
    code = "import sys; sys.argv = ['rig', 'verify', '--', '--help']\nimport api.cli.app\n"
    code += "try: api.cli.app.main()\nexcept SystemExit: pass\nassert 'numpy' in sys.modules"
    subprocess.run([sys.executable, "-c", code], capture_output=True, cwd=tmp_path, check=True)
