"""``python -m tools.packaged DIST``: what was built in DIST works where there is no checkout.

The wheel is installed by pipx and plays the demonstration; the source distribution is installed by uv and fits the
measured example. Both get the versions of ``requirements.lock``, and neither sees this folder or its environment.
"""

import os
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("rig", "drivers", "controller", "api", "mock_devices")
UNPACKED = "api/page/sources/"
EXAMPLES = ("diagnosis", "indentation", "quick")
# What is packed beside the packages: the page as it is built, and protocols to begin with.
BESIDE = ("api/page/built/index.html", *(f"api/protocols/{name}.toml" for name in EXAMPLES))
BIN = Path(sys.executable).parent
# The demonstration takes two minutes; CI has four for all of it.
DEMONSTRATION_S = 200


def missing(wheel: Path, root: Path = ROOT) -> list[str]:
    """Files of the five packages that the wheel has not: modules, pages, templates, parameters."""
    with zipfile.ZipFile(wheel) as archive:
        packed = set(archive.namelist())
    return sorted(name for name in {*_files(root), *BESIDE} if name not in packed)


def _files(root: Path) -> Iterator[str]:
    for package in PACKAGES:
        for path in (root / package).rglob("*"):
            name = path.relative_to(root).as_posix()
            if path.is_file() and "__pycache__" not in path.parts and not name.startswith(UNPACKED):
                yield name


def install_wheel(wheel: Path, folder: Path) -> Path:
    """Installs ``wheel`` by pipx below ``folder``; returns its `rig`."""
    places = {"PIPX_HOME": str(folder / "pipx"), "PIPX_BIN_DIR": str(folder / "bin")}
    _run(folder, [str(BIN / "pipx"), "install", "--backend", "uv", "--python", sys.executable, str(wheel)], places)
    return folder / "bin" / "rig"


def install_source(source: Path, folder: Path) -> Path:
    """Installs the distribution ``source`` by uv below ``folder``; returns its `rig`."""
    uv, python = str(BIN / "uv"), str(folder / "venv" / "bin" / "python")
    _run(folder, [uv, "venv", "--quiet", "--python", sys.executable, str(folder / "venv")])
    _run(folder, [uv, "pip", "install", "--quiet", "--python", python, str(source)])
    return folder / "venv" / "bin" / "rig"


def play(rig: Path, folder: Path) -> None:
    """The demonstration in ``folder``; its report and summary must be there."""
    _run(folder, [str(rig), "demo", "--trials", "1", "--out", "demo"], timeout_s=DEMONSTRATION_S)
    for name in ("report.html", "summary.json"):
        if not (folder / "demo" / name).stat().st_size:
            sys.exit(f"the demonstration left {name} empty")


def fit(rig: Path, source: Path, folder: Path) -> None:
    """Imports and fits the example that lies in the distribution ``source``."""
    with tarfile.open(source) as archive:
        archive.extractall(folder, filter="data")
    (examples,) = folder.glob("*/examples")
    _run(folder, [str(rig), "import", str(examples / "measured"), "--out", "session"])
    _run(folder, [str(rig), "fit", "session"])


def _run(folder: Path, command: list[str], places: dict[str, str] | None = None, timeout_s: float = 120.0) -> None:
    """Runs ``command`` in ``folder`` with nothing of this environment but uv, and ends the program where it fails."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
    # pipx looks for uv on the path; the link leads to nothing else of this environment.
    (folder / "tools").mkdir(exist_ok=True)
    if not (folder / "tools" / "uv").exists():
        (folder / "tools" / "uv").symlink_to(BIN / "uv")
    path = os.pathsep.join([str(folder / "tools"), "/usr/local/bin", "/usr/bin", "/bin"])
    clean = kept | {"PATH": path, "UV_CONSTRAINT": str(ROOT / "requirements.lock")} | (places or {})
    done = subprocess.run(
        command, cwd=folder, env=clean, timeout=timeout_s, check=False, capture_output=True, text=True
    )
    if done.returncode:
        sys.exit(f"{' '.join(command)} ended with {done.returncode}\n{done.stdout}{done.stderr}")


def main() -> None:
    """Checks what lies in the folder that is given, one wheel and one source distribution."""
    dist = Path(sys.argv[1]).resolve()
    (wheel,), (source,) = dist.glob("*.whl"), dist.glob("*.tar.gz")
    if absent := missing(wheel):
        sys.exit(f"{wheel.name} lacks {', '.join(absent)}")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        fit(install_source(source, folder), source, folder)
        play(install_wheel(wheel, folder), folder)
    sys.stdout.write(f"{wheel.name} and {source.name} install and run by themselves\n")


if __name__ == "__main__":
    main()
