"""The load of `benchmarks.service.clients` in its process, and what came of it, phase by phase."""

import contextlib
import json
import os
import subprocess
import sys
from typing import Any

from api.http.access.scopes import Scope
from mock_devices.testing.access import token
from mock_devices.testing.commands import ROOT

ENDING_S = 300.0  # a client of low priority on a busy computer


class Clients:
    """50 live clients and 200 requests a second at ``port`` of this computer, until the block ends."""

    def __init__(self, port: int) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.service.clients", str(port)],
            cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env=os.environ | {"TISSUE_RIG_TOKEN": token(Scope.READ)},
        )  # fmt: skip

    def __enter__(self) -> "Clients":
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._process.communicate(timeout=ENDING_S)
        finally:
            self._process.kill()

    def counted(self) -> dict[str, Any]:
        """What came since the start, as `clients.Load` has it; empty where the process has ended."""
        assert self._process.stdin and self._process.stdout
        with contextlib.suppress(OSError):
            print(file=self._process.stdin, flush=True)
        found: dict[str, Any] = json.loads(self._process.stdout.readline() or "{}")
        return found
