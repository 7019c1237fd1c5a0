"""The fuzz run in small, and that it finds a crash that was planted."""

import pytest

from benchmarks import fuzz

FORGIVING = 400


def test_no_codec_crashes_on_a_few_thousand_strings() -> None:
    assert fuzz.run(14 * FORGIVING, 7, fuzz.codecs()) == []


def test_a_planted_crash_is_found_and_told_with_its_string(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fragile(data: bytes) -> int:
        return data[3]

    monkeypatch.setattr(fuzz, "codecs", lambda: {"fragile": fuzz.Codec(fragile), "well": fuzz.Codec(len)})
    assert fuzz.main(["--count", "2000", "--seed", "1"]) == 1
    told = capsys.readouterr().out
    assert "fragile: IndexError: index out of range on " in told
    assert "2000 strings, 2 codecs, seed 1: " in told
    assert "well:" not in told


def test_what_a_codec_may_raise_is_no_crash_and_anything_else_is() -> None:
    def refuse(data: bytes) -> None:
        raise ValueError(data)

    assert fuzz.run(50, 1, {"refusing": fuzz.Codec(refuse, (ValueError,))}) == []
    assert len(fuzz.run(50, 1, {"refusing": fuzz.Codec(refuse, (KeyError,))})) == 50


def test_the_same_seed_makes_the_same_strings() -> None:
    seen: list[list[bytes]] = [[], []]
    for strings in seen:
        fuzz.run(200, 3, {"seen": fuzz.Codec(strings.append)})
    assert seen[0] == seen[1]
    assert len(set(seen[0])) > 150
