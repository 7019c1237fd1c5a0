"""An S3 server on the loopback, in a thread of the tests, with buckets of their own."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import fsspec
import pytest

BUCKET = "lab"
REGION = "us-east-1"


@contextmanager
def served(patch: pytest.MonkeyPatch) -> Iterator[str]:
    """The address of the server, with credentials for it in the environment."""
    from moto.server import ThreadedMotoServer  # noqa: PLC0415 - takes a second

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    host, port = server.get_host_and_port()
    endpoint = f"http://{host}:{port}"
    names = ("AWS_ENDPOINT_URL", "AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_DEFAULT_REGION")
    for name, value in zip(names, (endpoint, "test", "test", REGION), strict=True):
        patch.setenv(name, value)
    try:
        fsspec.filesystem("s3", skip_instance_cache=True).mkdir(BUCKET)
        yield endpoint
    finally:
        server.stop()


def upload(folder: Path, name: str) -> str:
    """The address of a copy of ``folder``."""
    store = fsspec.filesystem("s3", skip_instance_cache=True)
    for file in sorted(folder.rglob("*")):
        if file.is_file():
            store.put_file(str(file), f"{BUCKET}/{name}/{file.relative_to(folder)}")
    return f"s3://{BUCKET}/{name}"
