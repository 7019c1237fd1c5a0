"""What the command says the law reaches is the worst subject's, by the functions that hold the bounds."""

import pytest

from benchmarks.control import reached
from mock_devices.testing.made import law_in_simulation as held
from mock_devices.testing.made.subjects import NAMES


def test_of_each_figure_the_worst_subject_is_printed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Subjects are as good as their place in the list, and right models twice as good as wrong ones."""

    def jumps(name: str, stiffness: float) -> tuple[float, float]:
        share = NAMES.index(name) * (0.5 if stiffness == 1.0 else 1.0)
        return share, 0.01 * share

    monkeypatch.setattr(held, "moved_mN", lambda force_N: 10 * force_N)
    for one in ("breathing_mN", "sine_mN"):
        monkeypatch.setattr(held, one, lambda name, *_: float(NAMES.index(name)))
    monkeypatch.setattr(held, "law", lambda name: name)
    for one in ("peak", "rms_mN"):
        monkeypatch.setattr(held, one, lambda _, name, *__: float(NAMES.index(name)))
    monkeypatch.setattr(held, "low_jumps", jumps)
    monkeypatch.setattr(held, "jumps", lambda _, name, __, stiffness: jumps(name, stiffness))
    reached.main()
    told = capsys.readouterr().out
    assert "limb 2 Hz: 5.0 10.0 20.0 50.0 100.0\nbreathing: 4.0 4.0\n" in told
    assert "jumps of 0.3 N, wrong model: 4.000 0.040\njumps of 1 N, wrong model: 4.000 0.040\n" in told
    assert "jumps of 0.3 N, right model: 2.000 0.020\njumps of 1 N, right model: 2.000 0.020\n" in told
    assert "contact at 0.3 N: 4.000\nsine 0.5 Hz: 4.0\n" in told
    assert told.endswith("standing, 0.5 N: 4.0\nstanding, 10 N: 4.0\n")
