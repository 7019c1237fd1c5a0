"""Every test of the catalogue runs on SQLite and on a real PostgreSQL."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.api.catalogue.server import cluster, emptied

POSTGRESQL = pytest.param(
    "postgresql", marks=[pytest.mark.bench, pytest.mark.xdist_group("postgresql")], id="postgresql"
)


@pytest.fixture(scope="session")
def postgresql() -> Iterator[Path]:
    """A server for all tests of one worker."""
    with cluster() as folder:
        yield folder


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """An empty folder of sessions."""
    (tmp_path / "sessions").mkdir()
    return tmp_path / "sessions"


@pytest.fixture(params=["sqlite", POSTGRESQL])
def database(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Where a new catalogue is to be, as --catalogue takes it."""
    if request.param == "sqlite":
        return str(tmp_path / "catalogue.sqlite")
    return emptied(request.getfixturevalue("postgresql"))
