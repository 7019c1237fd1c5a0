"""An answer leaves whole: a kernel that holds back its second part makes every request of one connection wait 40 ms."""

import contextlib
import http.client
import socket
import statistics
import threading
import time
from collections.abc import Iterator

import pytest
import uvicorn
from fastapi import FastAPI

from api.cli.serve import listening_at

HOST, REQUESTS = "127.0.0.1", 40
SETTLED = 20  # a fresh connection is acknowledged at once for a while (tcp(7), TCP_QUICKACK)


@contextlib.contextmanager
def answering(listening: socket.socket) -> Iterator[int]:
    """The server that the service uses, with an interface that has nothing to do; its port."""
    server = uvicorn.Server(uvicorn.Config(FastAPI(), log_level="error"))
    thread = threading.Thread(target=server.run, args=([listening],))
    thread.start()
    try:
        yield listening.getsockname()[1]
    finally:
        server.should_exit = True
        thread.join()


def median_ms(port: int) -> float:
    """Of the answers over one connection."""
    connection, times_ms = http.client.HTTPConnection(HOST, port), []
    for _ in range(REQUESTS):
        began = time.monotonic()
        connection.request("GET", "/openapi.json")
        connection.getresponse().read()
        times_ms.append(1e3 * (time.monotonic() - began))
    connection.close()
    return statistics.median(times_ms[SETTLED:])


@pytest.mark.parametrize("plain", [False, True], ids=["as the service listens", "planted: as a socket is by itself"])
def test_an_answer_does_not_wait_for_the_clients_acknowledgement(plain: bool) -> None:
    listening = socket.create_server((HOST, 0)) if plain else listening_at(HOST, 0)
    with answering(listening) as port:
        assert (median_ms(port) > 30) == plain
