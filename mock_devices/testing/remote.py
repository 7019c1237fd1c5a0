"""A mock in another process, in real time, spoken to line by line."""

import contextlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any


class RemoteMock:
    """The process ``python -m MODULE``: it prints its endpoints, then answers each order; every line is JSON."""

    def __init__(self, module: str, *arguments: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            cwd=Path(__file__).parents[2],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.endpoints: dict[str, str] = self._answer()

    @property
    def address(self) -> str:
        """Where a driver finds it."""
        served = self.endpoints
        return served.get("serial") or served.get("slcan") or f"tcp://{served['tcp']}"

    def fault(self, name: str, value: object = True) -> None:
        """Sets a fault and waits until it is set."""
        self.order(fault=name, value=value)

    def order(self, **order: object) -> dict[str, Any]:
        """Sends an order and returns what is answered once it is obeyed."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        return answer

    def close(self) -> None:
        """Ends the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        self._process.wait(10)
        self._process.stdout.close()


def say(answer: object) -> None:
    """The other end: one line of JSON."""
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()
