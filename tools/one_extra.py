"""Each extra by itself: tissue-rig's own dependencies and exactly that one in a fresh environment, and what it is for.

``python -m tools.one_extra [EXTRA ...]``; without a package registry it says so and checks nothing.
"""

import os
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
UV = Path(sys.executable).with_name("uv")
# All wheels of the lock come from a cache in seconds, from a registry in a minute.
LONGEST_S = 300.0
# Extras for those who work on tissue-rig, which `make` installs whole.
OWN = frozenset({"dev", "docs"})


@dataclass(frozen=True)
class Smoke:
    """What an extra brings to import, and what of tissue-rig works with it."""

    module: str
    works: str


def exchanging(extra: str, module: str) -> Smoke:
    """An extra of which `tools.exchanges` has an exchange."""
    return Smoke(module, f"from tools.exchanges.{extra} import exchange; exchange()")


# For gs_usb there is no adapter here, nor a simulated one: its library has to load, and no more.
SMOKES: Mapping[str, Smoke] = {
    "cluster": exchanging("cluster", "distributed"),
    "foxglove": exchanging("foxglove", "foxglove"),
    "glove": exchanging("glove", "pyfirmata2"),
    "gs_usb": Smoke("gs_usb", "from can.interfaces.gs_usb import GsUsbBus"),
    "igtl": exchanging("igtl", "pyigtl"),
    "lsl": exchanging("lsl", "pylsl"),
    "multicast": exchanging("multicast", "msgpack"),
    "pandas": Smoke("pandas", "import rig.notebook as n, pyarrow as p; n.to_pandas(p.table({'a': [1]}))"),
    "postgresql": exchanging("postgresql", "psycopg"),
    "s3": exchanging("s3", "s3fs"),
    "zaber": exchanging("zaber", "zaber_motion"),
}


class NoRegistry(Exception):
    """Packages cannot be had here."""


def extras() -> list[str]:
    """Those that `pyproject.toml` names for users."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return sorted(set(project["optional-dependencies"]) - OWN)


def installed(folder: Path, extra: str) -> Path:
    """Python of a new environment in ``folder`` with the base and ``extra``, at the versions of the lock."""
    python = folder / "bin" / "python"
    _uv("venv", "--quiet", "--python", sys.executable, str(folder))
    asked = ["--extra", extra] if extra else []
    versions = folder / "versions.txt"
    versions.write_text("\n".join(line.split(" \\")[0] for line in _pins()) + "\n")
    _uv("pip", "install", "--quiet", "--python", str(python), "-r", "pyproject.toml", *asked, "-c", str(versions))
    return python


def _pins() -> list[str]:
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    return [line for line in lines if line[:1].isalnum()]


def _uv(*arguments: str) -> None:
    done = subprocess.run([UV, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=LONGEST_S, check=False)
    if done.returncode:
        trouble = done.stderr.strip()
        unreachable = any(word in trouble.lower() for word in ("connect", "dns", "fetch", "timed out", "network"))
        raise NoRegistry(trouble.splitlines()[-1]) if unreachable else RuntimeError(trouble)


def run(python: Path, code: str) -> str:
    """What ``code`` says in that environment, tissue-rig on its path; empty where all is well."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [str(python), "-c", code]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=60, check=False)
    return "" if done.returncode == 0 else done.stderr.strip() or f"exit code {done.returncode}"


def trouble_of(extra: str, folder: Path) -> str:
    """What is wrong with ``extra`` alone; empty where nothing is."""
    python = installed(folder, extra)
    smoke = SMOKES[extra]
    commands = "import api.cli.app, controller.loop.process, rig.recording.recorder"
    return run(python, f"{commands}; import {smoke.module}") or run(python, smoke.works)


def main(asked: Sequence[str]) -> int:
    """Tries each; 1 where one does not work."""
    worked = True
    for extra in asked or extras():
        with tempfile.TemporaryDirectory(prefix="rig-extra-") as folder:
            try:
                trouble = trouble_of(extra, Path(folder) / "venv")
            except NoRegistry as error:
                sys.stdout.write(f"no package registry answers here, so no extra is tried by itself: {error}\n")
                return 0
        sys.stdout.write(f"{extra}: {trouble or 'works by itself'}\n")
        worked = worked and not trouble
    return 0 if worked else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
