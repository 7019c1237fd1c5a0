"""One object from a store on this computer."""

import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import fsspec

OBJECT = b"0.0,1.0\n"


class _Store(BaseHTTPRequestHandler):
    """Has the same object under every key."""

    protocol_version = "HTTP/1.1"

    def do_HEAD(self) -> None:
        """How large it is."""
        self.send_response(200)
        self.send_header("Content-Length", str(len(OBJECT)))
        self.send_header("ETag", '"1"')
        self.end_headers()

    def do_GET(self) -> None:
        """What it holds."""
        self.do_HEAD()
        self.wfile.write(OBJECT)

    def log_message(self, *_: object) -> None:
        """Nobody reads it."""


def exchange() -> None:
    """Its bytes."""
    with ThreadingHTTPServer(("127.0.0.1", 0), _Store) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        files = fsspec.filesystem("s3", anon=True, endpoint_url=f"http://127.0.0.1:{server.server_port}")
        assert files.cat_file("bucket/trial.csv") == OBJECT
        server.shutdown()
