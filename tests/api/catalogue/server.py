"""A PostgreSQL server of its own in a temporary folder, on a unix socket alone; user postgres for root."""

import contextlib
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import psycopg

from tests.lacking import lacking

STARTS_S = 60.0
# Debian keeps the server's programs out of the path.
DEBIAN = sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
SPEED = ("fsync=off", "synchronous_commit=off", "full_page_writes=off", "shared_buffers=32MB")


def programs() -> Path | None:
    """The folder with `initdb` and `postgres`; Debian's first, since a link to one of them finds no library."""
    found = shutil.which("initdb")
    folders = [*DEBIAN, *([Path(found).resolve().parent] if found else [])]
    return next((folder for folder in folders if (folder / "initdb").exists() and (folder / "postgres").exists()), None)


def account() -> str | None:
    """The server refuses to run as root."""
    return "postgres" if os.geteuid() == 0 else None


@contextlib.contextmanager
def cluster() -> Iterator[Path]:
    """A server for the block, by the folder of its socket; without one the test cannot run."""
    found = programs()
    if found is None:
        lacking("no PostgreSQL here; `make test` installs it where it may (apt-get install postgresql)")
    user = account()
    with tempfile.TemporaryDirectory(prefix="rig-pg-") as name:
        folder = Path(name)
        if user:
            owner = pwd.getpwnam(user)
            os.chown(folder, owner.pw_uid, owner.pw_gid)
        with _served(found, folder, user):
            yield folder


@contextlib.contextmanager
def _served(found: Path, folder: Path, user: str | None) -> Iterator[None]:
    data = folder / "data"
    initdb = [
        found / "initdb",
        "-D",
        data,
        "-U",
        "postgres",
        "-A",
        "trust",
        "--no-sync",
        "-E",
        "UTF8",
        "--locale=C.UTF-8",
    ]
    subprocess.run([*map(str, initdb)], user=user, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    options = [part for setting in (*SPEED, "listen_addresses=") for part in ("-c", setting)]
    command = [str(found / "postgres"), "-D", str(data), "-k", str(folder), *options]
    with (folder / "log").open("w") as log:
        server = subprocess.Popen(command, user=user, cwd=folder, stdout=log, stderr=log)
    try:
        _wait(folder, server)
        yield
    finally:
        server.send_signal(signal.SIGQUIT)  # nothing of it is kept, so nothing is put in order
        server.wait(30)


def _wait(folder: Path, server: "subprocess.Popen[bytes]") -> None:
    deadline_s = time.monotonic() + STARTS_S
    while True:
        assert server.poll() is None, (folder / "log").read_text()
        try:
            psycopg.connect(address(folder, "postgres")).close()
        except psycopg.OperationalError:
            assert time.monotonic() < deadline_s, (folder / "log").read_text()
            time.sleep(0.05)
        else:
            return


def address(folder: Path, database: str) -> str:
    """How clients name a database of the server in ``folder``."""
    return f"postgresql://postgres@/{database}?host={folder}"


def emptied(folder: Path) -> str:
    """The server's one database without any table, by its address; a new one takes seconds."""
    found = address(folder, "postgres")
    with psycopg.connect(found, autocommit=True) as connection:
        connection.execute("DROP SCHEMA public CASCADE")
        connection.execute("CREATE SCHEMA public")
    return found
