"""Hooks before a commit are local: nothing is downloaded for them, and each is a tool that the lock brings."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_every_hook_is_local_and_its_tool_is_locked() -> None:
    text = (ROOT / ".pre-commit-config.yaml").read_text()
    assert set(re.findall(r"repo: (\S+)", text)) == {"local"}
    tools = re.findall(r"entry: \.venv/bin/(\S+)", text)
    assert len(tools) == len(re.findall(r"- id:", text)) == len(re.findall(r"language: system", text))
    packages = {"lint-imports": "import-linter"}
    for tool in tools:
        assert re.search(rf"^{packages.get(tool, tool)}==", (ROOT / "requirements.lock").read_text(), re.MULTILINE)
