"""How long commands take to begin: `python -m benchmarks.start [--repeats 5]`; the last line is one JSON object.

Help of every command, and `rig simulate` to the first line of its result (figures come after it); beside them, in the
same run, an interpreter that imports typer alone and `uvicorn --help`. Times are those of the whole process, on the
clock and of the processor (user and system); each is the median.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from api.cli.app import COMMANDS

ROOT = Path(__file__).parents[1]
BIN = Path(sys.executable).parent
MODEL = ROOT / "examples" / "forearm-model.json"
Spent = Callable[[Sequence[str], Path], tuple[float, float]]
# Compiled modules are kept, as in every installation.
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def spent_s(command: Sequence[str], folder: Path) -> tuple[float, float]:
    """Clock and processor time of one run."""
    before, began = os.times(), time.monotonic()
    subprocess.run(
        command, cwd=folder, env=ENVIRONMENT, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    after = os.times()
    own = after.children_user - before.children_user + after.children_system - before.children_system
    return time.monotonic() - began, own


def spent_to_result_s(command: Sequence[str], folder: Path) -> tuple[float, float]:
    """Clock and processor time to the first line that it prints."""
    began = time.monotonic()
    with subprocess.Popen(
        command, cwd=folder, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        assert process.stdout and process.stdout.readline()
        clock_s = time.monotonic() - began
        # Behind the name, which may hold spaces: fields 14 and 15 of proc_pid_stat(5).
        ticks = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[11:13]
        process.stdout.read()
    assert process.returncode == 0
    return clock_s, sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")


def medians(command: Sequence[str], folder: Path, repeats: int, spent: Spent = spent_s) -> dict[str, float]:
    """Of ``repeats`` runs after one that warms up."""
    spent(command, folder)
    clock, processor = zip(*(spent(command, folder) for _ in range(repeats)), strict=True)
    return {"clock_s": round(statistics.median(clock), 3), "processor_s": round(statistics.median(processor), 3)}


def main() -> None:
    """Measures and prints."""
    described = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(prog="python -m benchmarks.start", description=described)
    parser.add_argument("--repeats", type=int, default=5)
    repeats = parser.parse_args().repeats
    commands = {
        "typer alone": [sys.executable, "-c", "import typer"],
        "uvicorn --help": [str(BIN / "uvicorn"), "--help"],
        **{f"{name} --help": [str(BIN / "rig"), name, "--help"] for name in COMMANDS},
        "simulate": [str(BIN / "rig"), "simulate", "--model", str(MODEL), "--reference", "step:5"],
    }
    found: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as name:
        for title, command in commands.items():
            spent = spent_to_result_s if title == "simulate" else spent_s
            found[title] = medians(command, Path(name), repeats, spent)
            print(
                f"{title:20}{found[title]['clock_s']:8.2f} s{found[title]['processor_s']:8.2f} s of processor",
                flush=True,
            )
    helps = (found[f"{name} --help"]["clock_s"] for name in COMMANDS)
    print(json.dumps({**found, "slowest_help_s": max(helps)}))


if __name__ == "__main__":
    main()
