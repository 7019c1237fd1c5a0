"""What docs/api shows is run against a service on the mock bench: Python (```py) and shell (```bash), in order."""

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from api.http.access.scopes import Scope
from mock_devices.testing.access import token
from mock_devices.testing.commands import ServedBench
from mock_devices.testing.service import ServedRig

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs" / "api").glob("*.md"))
BLOCK = re.compile(r"```(py|bash)\n(.*?)```", re.DOTALL)
CELL = "# cell\n"


def blocks(text: str) -> list[tuple[str, str]]:
    """What is run, in order: each block by itself, and all cells of a page together, behind them."""
    found = BLOCK.findall(text)
    cells = "\n".join(block for _, block in found if block.startswith(CELL))
    return [(language, block) for language, block in found if not block.startswith(CELL)] + (
        [("py", cells)] if cells else []
    )


def ran(language: str, text: str, rig: ServedRig, folder: Path) -> subprocess.CompletedProcess[str]:
    command = {"py": [sys.executable, "-W", "error", "-c"], "bash": ["bash", "-euo", "pipefail", "-c"]}[language]
    return subprocess.run(
        [*command, text.replace("127.0.0.1:8000", f"127.0.0.1:{rig.port}")],
        cwd=folder, capture_output=True, text=True, timeout=240, check=False,
        env=os.environ | {"TISSUE_RIG_TOKEN": token(Scope.OPERATE), "MPLBACKEND": "agg"},
    )  # fmt: skip


@pytest.mark.documents
@pytest.mark.timeout(600)
def test_every_example_of_every_page_works_on_one_service(bench: ServedBench, tmp_path: Path) -> None:
    rig = ServedRig(bench, tmp_path, bench.settings("stop.port=0"))
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    for page in PAGES:
        for language, text in blocks(page.read_text()):
            done = ran(language, text, rig, tmp_path)
            assert done.returncode == 0, f"{page.name}\n{text}\n{done.stdout}\n{done.stderr}"
            assert done.stdout.strip(), f"{page.name}: an example shows something\n{text}"
        assert rig.rig["state"] == "idle", f"{page.name} leaves the bench as it was"
    assert (tmp_path / "live.png").stat().st_size > 0 and b"</html>" in (tmp_path / "report.html").read_bytes()
    assert any(name.endswith("force.csv") for name in zipfile.ZipFile(tmp_path / "measured.zip").namelist())


def test_curl_python_notebook_and_streams_are_among_them() -> None:
    kinds = {page.name: {language for language, _ in blocks(page.read_text())} for page in PAGES}
    assert kinds.items() >= {"index.md": {"bash"}, "python.md": {"py"}, "streams.md": {"py", "bash"}}.items()


def test_cells_are_one_program_and_other_blocks_each_one() -> None:
    text = "```py\na\n```\n```py\n# cell\nb\n```\n```bash\nc\n```\n```py\n# cell\nd\n```\n```text\ne\n```\n"
    assert blocks(text) == [("py", "a\n"), ("bash", "c\n"), ("py", "# cell\nb\n\n# cell\nd\n")]
