"""A service without a bench, and a session in its folder."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.http.service import Service
from mock_devices.testing.access import client_of, in_control
from mock_devices.testing.made.synthetic import Bench, write_made_session
from rig.config.products.bota_sensone import BotaWiring
from rig.config.wiring import Wiring


@pytest.fixture
def service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Service:
    (tmp_path / "protocols").mkdir()
    made = Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), tmp_path / "sessions", tmp_path / "protocols")
    monkeypatch.setattr(made, "connect", lambda: None)
    return made


@pytest.fixture
def first(service: Service) -> Path:
    """A session of one trial."""
    return write_made_session(service.sessions / "first", Bench().cycles(trials=1, speeds_mm_s=(10.0,)))


@pytest.fixture
def client(service: Service) -> Iterator[TestClient]:
    """In control."""
    with client_of(service) as found:
        yield in_control(found)
