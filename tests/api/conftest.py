"""Every problem that a test of this folder is answered with has to be one that its route tells of, and no job outlasts
its module: it would meet what other tests put in the place of processes.
"""

import functools
import threading
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.http.jobs.board import JobBoard
from tests.api import described

PATIENCE_S = 30.0


@functools.cache
def _schema() -> dict[str, Any]:
    return described.description()


@pytest.fixture(autouse=True)
def _only_described_problems(monkeypatch: pytest.MonkeyPatch) -> None:
    # Here, and not in the threads of a test, where several would make it at once.
    schema, asked = _schema(), TestClient.request

    def request(client: TestClient, method: str, url: Any, **more: Any) -> Any:
        answer = asked(client, method, url, **more)
        if answer.headers.get("content-type") == described.PROBLEM and method != "HEAD":
            problem = f"{answer.status_code} {answer.json()['code']}"
            path = answer.request.url.path
            assert not described.undescribed(schema, method, path, problem), (method, path, problem)
        return answer

    monkeypatch.setattr(TestClient, "request", request)


@pytest.fixture(scope="module", autouse=True)
def _jobs_end_with_their_module() -> Iterator[None]:
    boards, make = list[JobBoard](), JobBoard.__init__

    def made(board: JobBoard, *arguments: Any) -> None:
        boards.append(board)
        make(board, *arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(JobBoard, "__init__", made)
        yield
    for board in boards:
        board.close()
    left = [thread for thread in threading.enumerate() if thread.name.startswith("job-")]
    for thread in left:
        thread.join(PATIENCE_S)
    assert not [thread.name for thread in left if thread.is_alive()]
