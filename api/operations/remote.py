"""The service that uses the bench, asked over HTTP by another command on the same computer."""

import json
from types import TracebackType
from typing import Any, Self
from urllib.error import HTTPError, URLError
from urllib.request import Request, urlopen

from controller.recovery.situation import Consent, Recovered
from rig.errors import DeviceError

# A recovery homes and retracts before it answers.
ANSWER_S = 180.0
HOLDER = "rig reset"
LEASE_S = 30.0


class RemoteBench:
    """A running service; inside a ``with`` block it is under this command's control."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._lease = ""

    def __enter__(self) -> Self:
        taken = self._call("POST", "/api/v1/control/lease", {"holder": HOLDER, "ttl_s": LEASE_S})
        self._lease = str(taken["lease_id"])
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._call("DELETE", "/api/v1/control/lease")
        except DeviceError:
            if error is None:
                raise

    def state(self) -> dict[str, Any]:
        """The bench as the service shows it."""
        return self._call("GET", "/api/v1/rig")

    def recover(self, consent: Consent) -> Recovered:
        """The service's own recovery."""
        agreed = {"clear": consent.clear, "retract": consent.retract, "home": consent.home}
        found = self._call("POST", "/api/v1/recover", agreed)
        asked = tuple((question["act"], question["question"]) for question in found["open"])
        return Recovered(tuple(found["happened"]), tuple(found["done"]), asked, found["missing"])

    def _call(self, method: str, path: str, body: object = None) -> dict[str, Any]:
        data = None if body is None else json.dumps(body).encode()
        headers = {"Content-Type": "application/json", "X-Control-Lease": self._lease}
        try:
            with urlopen(Request(self.address + path, data, headers, method=method), timeout=ANSWER_S) as reply:
                answer: dict[str, Any] = json.load(reply)
        except HTTPError as refusal:
            raise DeviceError(f"the service at {self.address} refuses: {_detail(refusal)}") from refusal
        except (URLError, OSError, ValueError) as error:
            raise DeviceError(
                f"the service at {self.address} uses the bench and does not answer ({error}); end it, then try again"
            ) from error
        return answer


def _detail(refusal: HTTPError) -> str:
    try:
        return str(json.load(refusal)["detail"])
    except (ValueError, KeyError, TypeError):
        return f"HTTP {refusal.code}"
