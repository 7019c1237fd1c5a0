"""Files sent as they were when they were asked for, though a recorder may be writing them."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

from fastapi import APIRouter, Depends, Header
from fastapi.params import Depends as Declared
from fastapi.responses import FileResponse, Response
from starlette.types import Message, Receive, Scope, Send

from api.http.jobs.views import FILE_TYPES
from api.http.problems import answer, responses

RANGE_REFUSED = 400, 416
RangeHeader = Annotated[str, Header(alias="Range", description="bytes=FIRST-LAST: a part of the file, with 206")]
SameHeader = Annotated[str, Header(alias="If-Range", description="the ETag that the part is of; of another all comes")]


async def _part(part: RangeHeader = "", same: SameHeader = "") -> None:
    """What the answer itself reads."""


# For each route that answers with a file, which serves parts of it.
RANGED = Depends(_part)
FILE_ANSWERS: dict[int | str, dict[str, Any]] = {
    200: {"content": {kind: {} for kind in FILE_TYPES}},
    206: {"description": "the part", "content": {kind: {} for kind in (*FILE_TYPES, "multipart/byteranges")}},
    **responses("416 range"),
}


Answering = TypeVar("Answering", bound=Callable[..., object])


def files_at(
    router: APIRouter, path: str, right: Declared, refused: Mapping[int | str, dict[str, Any]], summary: str
) -> Callable[[Answering], Answering]:
    """For what answers with a file: by GET, whole or in parts, and by HEAD, which says how large it is."""
    stated: dict[str, Any] = {
        "dependencies": [right, RANGED], "summary": summary, "response_class": FileResponse,
        "responses": {**FILE_ANSWERS, **refused},
    }  # fmt: skip

    def added(answering: Answering) -> Answering:
        router.head(path, **stated)(answering)
        return router.get(path, **stated)(answering)

    return added


class FileAsOfNow(FileResponse):
    """Sends as many bytes as its length promises: what is added to the file meanwhile belongs to the next request."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Ranges as in ``FileResponse`` (RFC 9110, section 14); raises FileNotFoundError where it was removed."""
        self.stat_result = Path(self.path).stat()
        self.set_stat_headers(self.stat_result)
        left, refused = 0, False

        async def no_more_than_promised(message: Message) -> None:
            nonlocal left, refused
            if message["type"] == "http.response.start":
                left, refused = _promised(message), message["status"] in RANGE_REFUSED
            elif message["type"] == "http.response.body":
                message = {**message, "body": message.get("body", b"")[:left]}
                left -= len(message["body"])
            if not refused:
                await send(message)

        await super().__call__(scope, receive, no_more_than_promised)
        if refused:
            await self._no_such_part(self.stat_result.st_size)(scope, receive, send)

    def _no_such_part(self, size: int) -> Response:
        text = f"{Path(self.path).name} has {size} bytes and not that part of them; write Range as bytes=0-99"
        return answer(416, "range", text, headers={"Content-Range": f"bytes */{size}"})


def _promised(start: Message) -> int:
    return next(int(value) for name, value in start["headers"] if name == b"content-length")
