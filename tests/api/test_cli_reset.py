"""`rig reset` and `rig doctor` without a bench: the conversation about consents, and a service asked instead."""

import json
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread
from typing import Any, ClassVar

import pytest

from api.cli import hardware
from api.cli.computing import here
from api.cli.recovery import ask
from api.operations.remote import RemoteBench
from api.operations.reset import Ask, Recover, reset
from controller.claims import Holder
from controller.operation import Cancelled, Operation
from controller.recovery.situation import ALL, Consent
from rig.errors import CheckFailed, DeviceError, UsageError
from rig.results.bench import Act, Question, ResetResult

HAPPENED = ("the drive is in fault: 0x8130",)
QUESTIONS: dict[Act, str] = {"clear": "may the fault be cleared?", "retract": "may the tip move out?"}


def patient(consent: Consent) -> ResetResult:
    """A bench that needs two consents, one after the other."""
    for act, question in QUESTIONS.items():
        if not consent.to(act):
            return ResetResult(happened=HAPPENED, open=(Question(act=act, question=question),))
    return ResetResult(happened=HAPPENED, done=("the fault was cleared", "the tip moved out"))


def converse(recover: Recover, agreed: Consent, ask: Ask) -> ResetResult:
    """As the command does it, which prints what is said."""
    operation = Operation("reset")
    return here(operation, lambda: reset(operation, recover, agreed, ask))


def test_each_consent_is_asked_for_once_and_then_it_is_done(capsys: pytest.CaptureFixture[str]) -> None:
    asked: list[str] = []

    def yes(_: Act, question: str) -> bool:
        asked.append(question)
        return True

    assert converse(patient, Consent(), yes).ready
    assert asked == list(QUESTIONS.values())
    assert capsys.readouterr().out.splitlines() == [
        HAPPENED[0], "the fault was cleared", "the tip moved out", "the bench is ready"
    ]  # fmt: skip


def test_what_was_agreed_to_beforehand_is_not_asked() -> None:
    def never(act: Act, question: str) -> bool:
        raise AssertionError((act, question))

    assert converse(patient, ALL, never).ready


def test_a_no_ends_it() -> None:
    with pytest.raises(CheckFailed, match="not agreed to: may the tip move out"):
        converse(patient, Consent(clear=True), lambda _act, _question: False)


def test_one_that_is_cancelled_while_it_asks_does_nothing_more() -> None:
    operation, consents = Operation("reset"), list[Consent]()

    def recover(consent: Consent) -> ResetResult:
        consents.append(consent)
        return patient(consent)

    def cancel(_act: Act, _question: str) -> bool:
        operation.cancel()
        return True

    with pytest.raises(Cancelled):
        operation.run(lambda: reset(operation, recover, Consent(), cancel))
    assert consents == [Consent()] and operation.progress.state == "stopped"
    assert operation.progress.log == HAPPENED


def test_without_a_terminal_the_question_names_the_option(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    with pytest.raises(UsageError, match=r"may the fault be cleared\? Agree with --clear, or to everything with --yes"):
        ask("clear", QUESTIONS["clear"])


class FakeService(BaseHTTPRequestHandler):
    """Answers as the service does; ``requests`` are kept."""

    requests: ClassVar[list[tuple[str, str, Any, str]]] = []
    refusal: ClassVar[str] = ""

    def _answer(self) -> None:
        length = int(self.headers.get("Content-Length") or 0)
        body = json.loads(self.rfile.read(length)) if length else None
        self.requests.append((self.command, self.path, body, self.headers.get("X-Control-Lease", "")))
        answers = {
            "/api/v1/control/lease": {"lease_id": "abc", "holder": "h", "since": "noon", "ttl_s": 30.0, "left_s": 30.0},
            "/api/v1/recover": {
                "happened": ["it fell"], "done": ["it stands"], "open": [], "missing": "", "ready": True
            },
            "/api/v1/rig": {
                "state": "not ready", "reason": "", "ready": False, "mode": "safe", "time_ns": 1, "force_N": None,
                "reference_N": None, "position_mm": None, "depth_mm": None, "missed": 0, "cycles": 1, "health": {},
                "lost": {}, "limits": {}, "control": {"holder": "", "since": "", "left_s": 0.0}, "job": None,
                "rates_Hz": {"force": 1000.0, "axis": 999.0, "marker": 60.0},
                "devices": {
                    "force": {"product": "BFT", "serial": "1", "firmware": "2", "state": "ok", "detail": ""},
                    "tracker": {"product": "NDI", "serial": "3", "firmware": "4", "state": "lost", "detail": "silent"},
                },
            },
        }  # fmt: skip
        text = json.dumps({"detail": self.refusal} if self.refusal else answers[self.path]).encode()
        self.send_response(409 if self.refusal else 200)
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)

    do_GET = do_POST = do_DELETE = _answer

    def log_message(self, *_: object) -> None:
        """Says nothing."""


@pytest.fixture
def service() -> Iterator[str]:
    FakeService.requests.clear()
    FakeService.refusal = ""
    with HTTPServer(("127.0.0.1", 0), FakeService) as server:
        Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_a_service_is_asked_under_a_lease_that_is_given_back(service: str) -> None:
    with RemoteBench(service) as remote:
        found = remote.recover(Consent(clear=True))
    assert found == ResetResult(happened=("it fell",), done=("it stands",))
    assert [(method, path, lease) for method, path, _, lease in FakeService.requests] == [
        ("POST", "/api/v1/control/lease", ""),
        ("POST", "/api/v1/recover", "abc"),
        ("DELETE", "/api/v1/control/lease", "abc"),
    ]
    assert FakeService.requests[1][2] == {"clear": True, "retract": False, "home": False}


def test_a_refusal_is_told_in_the_services_words(service: str) -> None:
    FakeService.refusal = "operator has been in control since noon"
    with pytest.raises(DeviceError, match="refuses: operator has been in control since noon"):
        RemoteBench(service).__enter__()


def test_a_service_that_does_not_answer_is_named() -> None:
    with pytest.raises(DeviceError, match=r"http://127\.0\.0\.1:9 uses the bench and does not answer"):
        RemoteBench("http://127.0.0.1:9").state()


def held(address: str) -> Holder:
    return Holder("/dev/ttyAXIS", 1, "rig serve", address, "noon", "")


def test_the_doctor_asks_the_service_and_opens_nothing(
    service: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(hardware, "holder", lambda _wiring: held(service))
    monkeypatch.setattr("controller.doctor.examine", lambda *_, **__: pytest.fail("a device was opened"))
    with pytest.raises(CheckFailed, match=r"^tracker: lost: silent$"):
        hardware.doctor(None, ["force.port=/dev/ttyF"], tmp_path / "doctor.json")
    devices = json.loads((tmp_path / "doctor.json").read_text())["devices"]
    assert [(found["role"], found["serial"], found["rate_Hz"]) for found in devices] == [
        ("force", "1", 1000.0), ("tracker", "3", 60.0)
    ]  # fmt: skip


def test_the_doctor_disturbs_no_capture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hardware, "holder", lambda _wiring: held(""))
    monkeypatch.setattr("controller.doctor.examine", lambda *_, **__: pytest.fail("a device was opened"))
    with pytest.raises(DeviceError, match=r"/dev/ttyAXIS is in use by `rig serve` \(process 1\) since noon"):
        hardware.doctor(None, ["force.port=/dev/ttyF"], None)
