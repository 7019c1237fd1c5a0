"""A file that grows while it is sent has the length that was promised."""

import asyncio
from pathlib import Path

import pytest
from starlette.types import Message, Scope

from api.http.downloads import FileAsOfNow

CHUNK = FileAsOfNow.chunk_size


def sent(response: FileAsOfNow, *headers: tuple[bytes, bytes]) -> tuple[int, bytes]:
    """Content-Length and body of ``response``."""
    messages: list[Message] = []

    async def send(message: Message) -> None:
        messages.append(message)

    async def receive() -> Message:
        return {"type": "http.disconnect"}

    scope: Scope = {"type": "http", "asgi": {"spec_version": "2.4"}, "method": "GET", "headers": list(headers)}
    asyncio.run(response(scope, receive, send))
    start, *bodies = messages
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
