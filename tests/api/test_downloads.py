"""A file that grows while it is sent has the length that was promised."""

import asyncio
import json
from pathlib import Path

import pytest
from starlette.types import Message, Scope

from api.http.downloads import FileAsOfNow

CHUNK = FileAsOfNow.chunk_size


def answered(response: FileAsOfNow, *headers: tuple[bytes, bytes]) -> list[Message]:
    """All that ``response`` sends."""
    messages: list[Message] = []

    async def send(message: Message) -> None:
        messages.append(message)

    async def receive() -> Message:
        return {"type": "http.disconnect"}

    scope: Scope = {"type": "http", "asgi": {"spec_version": "2.4"}, "method": "GET", "headers": list(headers)}
    asyncio.run(response(scope, receive, send))
    return messages


def sent(response: FileAsOfNow, *headers: tuple[bytes, bytes]) -> tuple[int, bytes]:
    """Content-Length and body of ``response``."""
    start, *bodies = answered(response, *headers)
    assert not bodies[-1]["more_body"]
    return int(dict(start["headers"])[b"content-length"]), b"".join(body["body"] for body in bodies)


@pytest.mark.parametrize("size", [0, 1, CHUNK - 1, CHUNK, CHUNK + 1])
@pytest.mark.parametrize("added", [0, 1, 3 * CHUNK])
def test_what_is_added_after_the_answer_began_is_not_sent(tmp_path: Path, size: int, added: int) -> None:
    growing = tmp_path / "trial_001.mcap"
    growing.write_bytes(b"a" * size)
    response = FileAsOfNow(growing, stat_result=growing.stat())
    with growing.open("ab") as file:
        file.write(b"b" * added)
    assert sent(response) == (size, b"a" * size)


def test_a_range_of_a_growing_file_is_that_range(tmp_path: Path) -> None:
    growing = tmp_path / "trial_001.mcap"
    growing.write_bytes(bytes(range(100)))
    assert sent(FileAsOfNow(growing, stat_result=growing.stat()), (b"range", b"bytes=10-19")) == (
        10,
        bytes(range(10, 20)),
    )


@pytest.mark.parametrize("asked", [b"bytes=100-", b"bytes=7-3", b"bytes=x-y", b"lines=1-2"])
def test_a_part_that_is_none_is_a_problem_that_says_how_many_bytes_there_are(tmp_path: Path, asked: bytes) -> None:
    whole = tmp_path / "trial_001.mcap"
    whole.write_bytes(bytes(100))
    start, body = answered(FileAsOfNow(whole), (b"range", asked))
    told = dict(start["headers"])
    assert (start["status"], told[b"content-type"]) == (416, b"application/problem+json")
    assert told[b"content-range"] == b"bytes */100"
    assert "trial_001.mcap has 100 bytes" in json.loads(body["body"])["detail"]
