"""A cohort of four subjects who came twice, and a folder for results that is of the tests alone."""

from pathlib import Path

import pytest

from mock_devices.testing.made.synthetic import Bench, index_force, write_made_session

STIFFNESS = {"A": (0.10, 0.11), "B": (0.16, 0.15), "C": (0.21, 0.20), "D": (0.13, 0.13)}


@pytest.fixture(scope="session")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("cohort")
    return [
        write_made_session(
            folder / f"{subject}{visit}",
            Bench(rate_Hz=250.0, force=index_force(a_N_mm=a)).cycles(trials=1, speeds_mm_s=(10.0, 20.0)),
            subject={"id": subject},
        )
        for subject, values in STIFFNESS.items()
        for visit, a in enumerate(values, start=1)
    ]


@pytest.fixture(autouse=True)
def own_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What is kept by other tests is not found."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "tissue-rig" / "results"
