"""README and docs are executed: every ```sh block, in order, each file in a folder of its own beside the examples.

A line that serves (`rig mock`, `rig serve`) is started, awaited until it says that it is ready, and ended; its port is
exchanged for one that is free here.
`make` lines are what runs this test, and are only checked to name targets that exist.
"""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from mock_devices.testing.commands import free_port

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(page for page in DOCS.rglob("*.md") if "_build" not in page.parts)]
EXECUTED = [page for page in PAGES if "```sh\n" in page.read_text()]
NOTEBOOKS = [page for page in PAGES if "```python\n" in page.read_text()]
CELL = re.compile(r"```python\n(.*?)```", re.DOTALL)
BLOCK = re.compile(r"```sh\n(.*?)```", re.DOTALL)
SERVING = ("rig mock", "rig serve")
LINE_TIMEOUT_S = 300


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def commands(page: Path) -> list[str]:
    return [
        line.partition("  #")[0].strip()
        for block in BLOCK.findall(page.read_text())
        for line in block.replace("\\\n", " ").splitlines()
        if line.strip() and not line.startswith("#")
    ]


def environment() -> dict[str, str]:
    return os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "120"}


def serve(command: str, folder: Path) -> None:
    words = shlex.split(re.sub(r"--port \d+", f"--port {free_port()}", command))
    process = subprocess.Popen(words, cwd=folder, env=environment(), stdout=subprocess.PIPE, text=True)
    assert process.stdout
    try:
        assert process.stdout.readline().strip(), f"{command} ended without saying that it is ready"
    finally:
        process.send_signal(signal.SIGINT)
        process.stdout.close()
        assert process.wait(30) == 0, command


def run(command: str, folder: Path) -> None:
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", command],
        cwd=folder,
        env=environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=LINE_TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}"


def check_make(command: str) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(shlex.split(command)[1:]) <= targets, command


def test_pages_in_folders_are_found_and_their_commands_too() -> None:
    named = [command for page in EXECUTED for command in commands(page)]
    for page, command in (("README.md", "make demo"), ("docs/tutorial/first-bench.md", "rig verify sessions/first")):
        assert command in commands(ROOT / page)
        assert ROOT / page in EXECUTED
        assert command in named


@pytest.mark.bench
@pytest.mark.documents
@pytest.mark.timeout(600)
@pytest.mark.parametrize("page", EXECUTED, ids=name)
def test_every_command_of_the_page_works_in_order(page: Path, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    for command in commands(page):
        if command.startswith("make"):
            check_make(command)
        elif command.startswith(SERVING):
            serve(command, tmp_path)
        else:
            run(command, tmp_path)


@pytest.mark.documents
@pytest.mark.parametrize("page", NOTEBOOKS, ids=name)
def test_every_cell_of_a_notebook_runs_in_order(page: Path, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    (tmp_path / "cells.py").write_text("\n".join(CELL.findall(page.read_text())))
    run(f"MPLBACKEND=agg {shlex.quote(sys.executable)} -W error cells.py", tmp_path)


def test_the_notebook_is_found() -> None:
    assert DOCS / "tutorial" / "notebook.md" in NOTEBOOKS


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_link_to_a_file_leads_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text())
    missing = [link for link in links if "://" not in link and not (page.parent / link).exists()]
    assert not missing


def test_every_dependency_has_its_line() -> None:
    listed = set(re.findall(r"[a-z0-9-]+", (DOCS / "reference" / "dependencies.md").read_text()))
    named = set(re.findall(r'^  "([a-z0-9-]+)[>=\[]', (ROOT / "pyproject.toml").read_text(), re.MULTILINE))
    assert named and named <= listed, sorted(named - listed)
