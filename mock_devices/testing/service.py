"""`rig serve` over a served bench."""

import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen
from uuid import uuid4

from mock_devices.testing.access import bearer
from mock_devices.testing.commands import PATIENCE_S, Running, ServedBench, children, free_port, until

ANSWER_S = 30.0  # connecting a device is waited for, and a busy computer


def ask(address: str, method: str, path: str, body: object = None, lease: str = "") -> Any:
    """One request of a program with every right to the service at ``address``; ``path`` is what follows /api/v1.

    A refusal is raised as HTTPError; what the service said of it stands in its notes.
    """
    data = None if body is None else json.dumps(body).encode()
    headers = {
        "Content-Type": "application/json",
        "X-Control-Lease": lease,
        **bearer(),
        "Idempotency-Key": uuid4().hex,
    }
    request = Request(f"{address}/api/v1{path}", data, headers, method=method)
    try:
        with urlopen(request, timeout=ANSWER_S) as answer:
            return json.load(answer)
    except HTTPError as error:
        error.add_note(error.read().decode())
        raise


class ServedRig:
    """A bench, the service on it, and requests to it; it is idle once this is made.

    ``stop_port`` is where its stop process listens.
    """

    def __init__(self, bench: ServedBench, folder: Path, arguments: Sequence[str | Path]) -> None:
        self.bench, self.folder, self.port = bench, folder, free_port()
        self.running = Running(["serve", "--port", str(self.port), *arguments], folder, subprocess.DEVNULL)
        self.becomes("idle")
        self.stop_port = int(self.ask("GET", "/info")["stop_port"])

    @property
    def address(self) -> str:
        """Where it listens."""
        return f"http://127.0.0.1:{self.port}"

    def ask(self, method: str, path: str, body: object = None, lease: str = "") -> Any:
        """One request; ``path`` is what follows /api/v1."""
        return ask(self.address, method, path, body, lease)

    def lease(self) -> str:
        """The right to move, for 30 s."""
        return str(self.ask("POST", "/control/lease", {"holder": "test", "ttl_s": 30.0})["lease_id"])

    @property
    def rig(self) -> dict[str, Any]:
        """The bench as it shows it; empty while it does not listen yet."""
        try:
            return dict(self.ask("GET", "/rig"))
        except OSError:
            return {}

    def becomes(self, state: str) -> None:
        """Waits for that state; fails with what a service that ended has said, or with what another shows."""
        shown: dict[str, Any] = {}

        def there() -> bool:
            assert self.running.process.poll() is None, self.running.end()
            shown.update(self.rig)
            return shown.get("state") == state

        try:
            until(there, PATIENCE_S, f"the service being {state}")
        except AssertionError as late:
            late.add_note(f"it shows: {shown}")
            raise

    @property
    def loop(self) -> int:
        """Process number of the loop."""
        (pid,) = children(self.running.process.pid, "controller.loop.process")
        return pid

    @property
    def stop_process(self) -> int:
        """Process number of the stop process."""
        (pid,) = children(self.running.process.pid, "controller.stop.server")
        return pid
