"""CONTRIBUTING.md is executed: the blocks of each walk-through, in order, in a process and a folder of its own.

A Python block that begins with `# folder/file.py` is that file, as if it stood in the repository; the others are run
one after another. Blocks of other languages are given to them as ``BLOCKS["tsx"]`` and so on.
"""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.system.browser import find

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "CONTRIBUTING.md"
SECTION = re.compile(r"^## (Add .*?)\n(.*?)(?=^## |\Z)", re.DOTALL | re.MULTILINE)
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
FILE = re.compile(r"# (\S+/\S+\.py)\n")
TIMEOUT_S = 110


class Block(NamedTuple):
    """One code block: its language and its text."""

    language: str
    text: str


WALKS = {title: [Block(*found) for found in BLOCK.findall(text)] for title, text in SECTION.findall(PAGE.read_text())}


def script(blocks: list[Block], folder: Path) -> str:
    """What runs ``blocks``, whose files are written below ``folder`` and found there as parts of our packages."""
    lines = ["import importlib", f"BLOCKS = {dict(block for block in blocks if block.language != 'python')!r}"]
    for language, text in blocks:
        file = FILE.match(text)
        if language != "python":
            continue
        if not file:
            lines.append(text)
            continue
        path = folder / file[1]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        package = next(
            parent for parent in path.parents if (ROOT / parent.relative_to(folder) / "__init__.py").exists()
        )
        name = ".".join(package.relative_to(folder).parts)
        lines.append(f"importlib.import_module({name!r}).__path__.append({str(package)!r})")
    return "\n".join(lines)


def run(blocks: list[Block], folder: Path) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", script(blocks, folder)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )


def test_there_is_a_walk_through_of_each_kind() -> None:
    kinds = ("device", "tissue law", "cause", "safety check", "route", "part of the page")
    assert list(WALKS) == [f"Add a {kind}" for kind in kinds]


@pytest.mark.every_commit
@pytest.mark.parametrize("title", WALKS)
def test_each_walk_through_works_as_it_stands(title: str, tmp_path: Path) -> None:
    if any(block.language == "tsx" for block in WALKS[title]):
        find()
    done = run(WALKS[title], tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_walk_through_that_is_wrong_is_noticed(tmp_path: Path) -> None:
    wrong = [*WALKS["Add a tissue law"], Block("python", 'assert law_named("cubic") is None\n')]
    assert "AssertionError" in run(wrong, tmp_path).stderr
