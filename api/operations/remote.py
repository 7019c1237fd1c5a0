"""The service that uses the bench, asked over HTTP by another command on the same computer."""

import json
from dataclasses import asdict
from types import TracebackType
from typing import Self, TypeVar
from urllib.error import HTTPError, URLError
from urllib.request import Request, urlopen

from pydantic import BaseModel

from controller.loop.messages import DeviceView
from controller.recovery.situation import Consent
from rig.errors import DeviceError
from rig.results.bench import ResetResult

# A recovery homes and retracts before it answers.
ANSWER_S = 180.0
HOLDER = "rig reset"
LEASE_S = 30.0
View = TypeVar("View", bound=BaseModel)


class LeaseTaken(BaseModel):
    """Of a lease, what this command needs; what else the service says is left aside, here as below."""

    lease_id: str = ""


class BenchSaid(BaseModel):
    """The bench as the service shows it."""

    state: str
    reason: str
    rates_Hz: dict[str, float]
    devices: dict[str, DeviceView]


class RemoteBench:
    """A running service; inside a ``with`` block it is under this command's control."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._lease = ""

    def __enter__(self) -> Self:
        self._lease = self._call(
            "POST", "/api/v1/control/lease", LeaseTaken, {"holder": HOLDER, "ttl_s": LEASE_S}
        ).lease_id
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._call("DELETE", "/api/v1/control/lease", LeaseTaken)
        except DeviceError:
            if error is None:
                raise

    def state(self) -> BenchSaid:
        """The bench as the service shows it."""
        return self._call("GET", "/api/v1/rig", BenchSaid)

    def recover(self, consent: Consent) -> ResetResult:
        """The service's own recovery."""
        return self._call("POST", "/api/v1/recover", ResetResult, asdict(consent))

    def _call(self, method: str, path: str, kind: type[View], body: object = None) -> View:
        data = None if body is None else json.dumps(body).encode()
        headers = {"Content-Type": "application/json", "X-Control-Lease": self._lease}
        try:
            with urlopen(Request(self.address + path, data, headers, method=method), timeout=ANSWER_S) as reply:
                return kind.model_validate_json(reply.read())
        except HTTPError as refusal:
            raise DeviceError(f"the service at {self.address} refuses: {_detail(refusal)}") from refusal
        except (URLError, OSError, ValueError) as error:
            raise DeviceError(
                f"the service at {self.address} uses the bench and does not answer ({error}); end it, then try again"
            ) from error


def _detail(refusal: HTTPError) -> str:
    try:
        return str(json.load(refusal)["detail"])
    except (ValueError, KeyError, TypeError):
        return f"HTTP {refusal.code}"
