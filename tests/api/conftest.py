"""Every problem that a test of this folder is answered with has to be one that its route tells of."""

import functools
from collections.abc import Callable
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.api import described


@functools.cache
def _schema() -> dict[str, Any]:
    return described.description()


@pytest.fixture(autouse=True)
def _only_described_problems(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: Callable[..., Any] = TestClient.request

    def request(client: TestClient, method: str, url: Any, **more: Any) -> Any:
        answer = asked(client, method, url, **more)
        if answer.headers.get("content-type") == described.PROBLEM:
            problem = f"{answer.status_code} {answer.json()['code']}"
            path = answer.request.url.path
            assert not described.undescribed(_schema(), method, path, problem), (method, path, problem)
        return answer

    monkeypatch.setattr(TestClient, "request", request)
