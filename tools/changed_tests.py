"""``python -m tools.changed_tests``: the tests of what changed since the branch left main, nearest first, for 18 s.

Nearest are tests that changed themselves, then those in the place that mirrors a changed module, then those that
import one. Tests that start real processes are left to `make test`, and so is what the time does not suffice for:
that is skipped, and said.
"""

import ast
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# Style, types and contracts take 5 s warm, loading the libraries 4 s: together less than half a minute.
BUDGET_S = 18.0
DOCUMENTS = (".md", ".toml")


def changed(root: Path) -> list[str]:
    """Paths that differ from where the branch left main, on main itself from the commit before, committed or not."""
    base = _git(root, "merge-base", "HEAD", "main") or _git(root, "rev-parse", "HEAD")
    if base == _git(root, "rev-parse", "HEAD"):
        base = _git(root, "rev-parse", "HEAD~1") or base
    listed = _git(root, "diff", "--name-only", base), _git(root, "ls-files", "--others", "--exclude-standard")
    return sorted({name for names in listed for name in names.splitlines()})


def _git(root: Path, *words: str) -> str:
    done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""


def choose(paths: Iterable[str], root: Path) -> list[str]:
    """Test files for the changed ``paths``, nearest first."""
    present = [path for path in paths if (root / path).exists()]
    tests = [path for path in present if _is_test(Path(path))]
    mirrored = [test for path in present for test in _mirrored(Path(path), root)]
    modules = {path.removesuffix(".py").removesuffix("/__init__").replace("/", ".") for path in paths if _is_code(path)}
    importing = [str(test.relative_to(root)) for test in _tests(root) if modules & _imported(test)]
    documents = ["tests/test_docs.py"] if any(path.endswith(DOCUMENTS) for path in present) else []
    return list(dict.fromkeys([*tests, *mirrored, *importing, *documents]))


def _is_code(path: str) -> bool:
    return path.endswith(".py")


def _is_test(path: Path) -> bool:
    return path.parts[0] == "tests" and path.name.startswith("test_") and path.suffix == ".py"


def _tests(root: Path) -> list[Path]:
    return sorted((root / "tests").rglob("test_*.py"))


def _mirrored(path: Path, root: Path) -> Iterator[str]:
    """Tests of a module: ``rig/config/stop.py`` has them in ``tests/rig/config/test_stop*.py``."""
    if path.suffix == ".py" and path.parts[0] != "tests":
        for test in sorted((root / "tests" / path.parent).glob(f"test_{path.stem}*.py")):
            yield str(test.relative_to(root))


def _imported(test: Path) -> set[str]:
    """Modules that a test file names in an import, and what it imports from packages."""
    named = set()
    for node in ast.walk(ast.parse(test.read_text())):
        if isinstance(node, ast.Import):
            named |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            named |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return named


class Deadline:
    """A pytest plugin that skips what begins after ``seconds``."""

    def __init__(self, seconds: float, now_s: Callable[[], float] = time.monotonic) -> None:
        """Begins now."""
        self._now_s, self._end_s = now_s, now_s() + seconds

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self) -> None:
        """Skips a test where the time is over."""
        if self._now_s() > self._end_s:
            pytest.skip("no time left in `make check`; `make test` runs it")


def main() -> None:
    """Runs the tests and ends with pytest's own code; no test to run is no failure."""
    tests = choose(changed(ROOT), ROOT)
    if not tests:
        sys.stdout.write("no test belongs to what changed\n")
        return
    code = pytest.main(["-q", "-m", "not bench", *tests], plugins=[Deadline(BUDGET_S)])
    sys.exit(0 if code == pytest.ExitCode.NO_TESTS_COLLECTED else code)


if __name__ == "__main__":
    main()
