"""The same request twice is one: an answer is kept for a day under the key that its sender gave it.

A lost answer is asked for again without the thing being done again. What was refused did nothing, so it may be tried
again under the same key. Kept on disk: a service that ended in the middle does not know whether it acted, and says so.
"""

import base64
import hashlib
import threading
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Annotated, Any

from fastapi import Depends, Header, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException

from api.http.access.rights import CALLER, PASSED, STOP
from api.http.access.secrets import steady_s
from api.http.answers import ERASED, KeptAnswer, add_answer, read_answers, write_answers, writing
from api.http.priority import following
from api.http.problems import NotDone, RequestRefused
from api.http.shared_file import FileState, file_state
from rig.errors import UsageError

KEPT_S = 24 * 3600.0
# A busy day's jobs; the oldest go first.
MOST_KEPT = 2000
REFUSED = 400
SENT_AGAIN = ("location", "etag", "content-type")
KEY = r"^[!-~]{1,100}$"
KeyHeader = Annotated[
    str,
    Header(
        alias="Idempotency-Key",
        pattern=f"^$|{KEY}",
        description="asked for by what moves: the same key with the same body gets the first answer again, for a day",
    ),
]
# What did nothing. All else, as a disk or a device that fails, may come after a command went out.
REFUSALS = (RequestRefused, UsageError, HTTPException, RequestValidationError)
Handler = Callable[[Request], Coroutine[Any, Any, Response]]


def refuse_without_key(key: str) -> None:
    """Raises RequestRefused: what moves must not move twice because an answer was lost."""
    if not key:
        text = "this moves the bench: send a header Idempotency-Key, new for each thing that is to happen once"
        raise RequestRefused(400, "idempotency-key", text)


async def _named(key: KeyHeader = "") -> str:
    return key


# For each route that heeds a key: so the description has it, and one that cannot be kept is refused.
NAMED = Depends(_named)


class AnswerStore:
    """Answers of a service, in ``file``. Safe from any thread; the event loop waits for one short line of it."""

    def __init__(self, file: Path, now_s: Callable[[], float] | None = None) -> None:
        self._file, self._now_s, self._lock = file, now_s or steady_s(), threading.Lock()
        self._kept: dict[str, KeptAnswer] = {}
        self._seen: FileState | None = None
        self._under_way: set[str] = set()

    def begin(self, place: str, body: bytes) -> KeptAnswer | None:
        """The answer given before; None where this is the first time, which is noted. Raises RequestRefused."""
        asked = hashlib.sha256(body).hexdigest()
        with self._lock:
            if self._seen is None and self._file.is_file():
                self._shorten()
            known = self._known().get(place)
            if known is None:
                self._begin(KeptAnswer(place=place, asked=asked, at_s=self._now_s()))
                return None
            if known.asked != asked:
                text = "this Idempotency-Key was sent with another body; a new request takes a new key"
                raise RequestRefused(422, "idempotency-key-reused", text)
            if known.status == ERASED:
                text = "this was answered before, and what it was about has been erased since; it is not done again"
                raise RequestRefused(404, "gone", text)
            if known.status:
                return known
            raise _undecided(place in self._under_way)

    def _begin(self, asked: KeptAnswer) -> None:
        try:
            self._write(asked)
        except OSError:  # it is not begun either, and may be tried again
            self._kept.pop(asked.place, None)
            raise
        self._under_way.add(asked.place)

    def end(self, place: str, response: Response | None, known: bool = True) -> None:
        """Keeps what was answered; a refusal, or None, is forgotten, so that it can be tried again.

        Not ``known``: nobody knows whether it took effect, and nothing is done under that key again.
        """
        with self._lock:
            self._under_way.discard(place)
            begun = self._known().get(place)
            if begun is None or not known:
                return
            if response is None or response.status_code >= REFUSED:
                self._write(begun.model_copy(update={"at_s": 0.0}))
                return
            headers = {name: response.headers[name] for name in SENT_AGAIN if name in response.headers}
            body = base64.b64encode(bytes(response.body)).decode()
            answer = {"status": response.status_code, "headers": headers, "body": body}
            self._write(begun.model_copy(update=answer))

    def _shorten(self) -> None:
        """Once a start: what is out of date leaves the file too."""
        with writing(self._file):
            write_answers(self._file, self._known().values())
            self._seen = file_state(self._file)

    def _known(self) -> dict[str, KeptAnswer]:
        now = file_state(self._file)
        if now and now != self._seen:  # an earlier service wrote it, or another program has erased some
            self._kept, self._seen = read_answers(self._file), now
        oldest_s = self._now_s() - KEPT_S
        self._kept = {place: each for place, each in self._kept.items() if each.at_s > oldest_s}
        return self._kept

    def _write(self, answer: KeptAnswer) -> None:
        with writing(self._file):
            known = self._known()
            known.pop(answer.place, None)
            if answer.at_s:
                known[answer.place] = answer
            while len(known) > MOST_KEPT:
                known.pop(next(iter(known)))
            add_answer(self._file, answer)
            self._seen = file_state(self._file)


def _undecided(under_way: bool) -> RequestRefused:
    if under_way:
        return RequestRefused(409, "in-progress", "the request with this Idempotency-Key is still being answered; wait")
    text = "the service ended or failed while it answered: look whether it took effect, and use a new key"
    return RequestRefused(409, "outcome-unknown", text)


def holds_secret(path: str) -> bool:
    """Whether what is answered there is kept by nobody but who asked."""
    return "/tokens" in path or "/auth/" in path


class FollowingRoute(APIRoute):
    """Whose endpoint, where it is given a thread, follows the event loop there."""

    def __init__(self, path: str, endpoint: Callable[..., Any], **stated: Any) -> None:
        super().__init__(path, following(endpoint), **stated)


def idempotent(store: AnswerStore) -> type[FollowingRoute]:
    """Routes whose POST heeds an Idempotency-Key."""

    class IdempotentRoute(FollowingRoute):
        """A stop that is asked for twice stops twice; what answers with a secret keeps none."""

        def __init__(self, path: str, endpoint: Callable[..., Any], **stated: Any) -> None:
            rights = stated.get("dependencies") or ()
            self._keeps = "POST" in (stated.get("methods") or ()) and not holds_secret(path) and STOP not in rights
            super().__init__(path, endpoint, **stated | {"dependencies": [*rights, *[NAMED] * self._keeps]})

        def get_route_handler(self) -> Handler:
            handler = super().get_route_handler()

            async def answered(request: Request) -> Response:
                key = request.headers.get("idempotency-key", "")
                caller = request.scope.get(CALLER)
                if not (self._keeps and key and caller):
                    return await handler(request)
                place = f"{caller.name} {request.url.path} {key}"
                return await _once(store, place, request, handler)

            return answered

    return IdempotentRoute


async def _told(request: Request) -> bytes:
    """What tells a request from another with its key: the body, or, of one that is read piece by piece, its length."""
    right = request.scope.get(PASSED)
    if right is not None and right.streamed:
        return request.headers.get("content-length", "").encode()
    return await request.body()


async def _once(store: AnswerStore, place: str, request: Request, handler: Handler) -> Response:
    before = store.begin(place, await _told(request))
    if before:
        body = base64.b64decode(before.body)
        return Response(body, before.status, {**before.headers, "Idempotent-Replayed": "true"})
    response: Response | None = None
    known = True
    try:
        response = await handler(request)
    except BaseException as error:
        known = isinstance(error, REFUSALS) and not isinstance(error, NotDone)
        raise
    finally:
        store.end(place, response, known)
    return response
