"""Ctrl-C while `rig` still loads: no traceback, and the code of an interrupted command, as later."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

# Presses Ctrl-C when the module in argv[1] is about to be loaded.
PRESSED = """
import os, signal, sys

class Keyboard:
    def find_spec(self, name, path, target=None):
        if name == pressed_at:
            os.kill(os.getpid(), signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)
pressed_at, sys.argv = sys.argv[1], ["rig", *sys.argv[2:]]
sys.meta_path.insert(0, Keyboard())
from api.cli.__main__ import main
main()
"""


@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("typer", ["fit", "no-such"]),
        ("api.cli.fitting", ["fit", "no-such"]),
        ("numpy", ["fit", "no-such"]),
        ("rich.console", ["fit", "no-such"]),
    ],
)
def test_ctrl_c_while_it_loads_ends_it_in_silence(module: str, words: list[str], tmp_path: Path) -> None:
    said = subprocess.run(
        [sys.executable, "-c", PRESSED, module, *words], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert (said.returncode, said.stdout, said.stderr) == (128 + signal.SIGINT, "", "")
