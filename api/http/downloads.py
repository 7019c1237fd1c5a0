"""Files sent as they were when they were asked for, though a recorder may be writing them."""

from pathlib import Path

from fastapi.responses import FileResponse
from starlette.types import Message, Receive, Scope, Send


class FileAsOfNow(FileResponse):
    """Sends as many bytes as its length promises: what is added to the file meanwhile belongs to the next request."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Ranges as in ``FileResponse`` (RFC 9110, section 14); raises FileNotFoundError where it was removed."""
        self.stat_result = Path(self.path).stat()
        self.set_stat_headers(self.stat_result)
        left = 0

        async def no_more_than_promised(message: Message) -> None:
            nonlocal left
            if message["type"] == "http.response.start":
                left = _promised(message)
            elif message["type"] == "http.response.body":
                message = {**message, "body": message.get("body", b"")[:left]}
                left -= len(message["body"])
            await send(message)

        await super().__call__(scope, receive, no_more_than_promised)


def _promised(start: Message) -> int:
    return next(int(value) for name, value in start["headers"] if name == b"content-length")
