"""Encodings older than Unicode are told by the header's words; a tie is a doubt with each reading of the header."""

from pathlib import Path

import pytest

from rig.intake.encodings import encoding_of
from rig.intake.proposal import propose
from tests.rig.intake.instruments import comma
from tests.rig.intake.test_foreign import FORCE_N, TIME_S, WAY_MM, came_in, check, lines

ROWS = comma(lines("{:.3f};{:.5f};{:.5f}", TIME_S, WAY_MM, FORCE_N))
RUSSIAN, CZECH = "Время;Перемещение;Усилие\nс;мм;Н\n", "Čas;Dráha;Síla\ns;mm;N\n"


@pytest.mark.parametrize(
    ("encoding", "head"),
    [
        ("koi8-r", RUSSIAN),
        ("cp866", RUSSIAN),
        ("cp1251", RUSSIAN),
        ("euc_jp", "時間;変位;荷重\n秒;mm;N\n"),
        ("cp1250", "Czas [s];Przemieszczenie [mm];Siła [N]\n"),
        ("cp1250", CZECH),
        ("cp852", CZECH),
        ("cp850", "Temps;Déplacement;Force\ns;mm;N\n"),
        ("cp1252", "Prüfzeit;Standardweg;Kraft\ns;mm;N\n"),
    ],
)
def test_the_header_says_its_encoding(folder: Path, encoding: str, head: str) -> None:
    (folder / "a.csv").write_bytes((head + ROWS).encode(encoding))
    proposal = propose(folder)
    assert proposal.tree["tables"][0]["encoding"] == encoding
    assert not [doubt for doubt in proposal.doubts if "encoding" in doubt]
    check(came_in(folder))


@pytest.mark.parametrize("encoding", ["cp437", "cp850"])
def test_encodings_that_read_the_header_alike_are_no_doubt(folder: Path, encoding: str) -> None:
    """A micrometre has another byte under DOS, and the same one in both of its encodings."""
    way = comma(lines("{:.3f};{:.3f};{:.5f}", TIME_S, WAY_MM * 1e3, FORCE_N))
    (folder / "a.csv").write_bytes(("Prüfzeit [s];Standardweg [µm];Kraft [N]\n" + way).encode(encoding))
    assert propose(folder).tree["tables"][0]["columns"]["position"]["column"] == "Standardweg [µm]"
    assert not [doubt for doubt in propose(folder).doubts if "encoding" in doubt]
    check(came_in(folder))


@pytest.mark.parametrize("encoding", ["koi8-r", "cp1251", "cp866", "cp437", "cp1250", "euc_jp"])
def test_a_tie_is_a_doubt_with_the_header_as_each_reads_it(encoding: str) -> None:
    header = {"cp437": "Größe;Höhe", "cp1250": "Źródło;Łącznik", "euc_jp": "検査;番号"}.get(
        encoding, "Датчик А;Датчик Б"
    )
    _, (doubt,) = encoding_of(f"{header}\n1;2\n".encode(encoding))
    assert repr(header) in doubt


def test_of_readings_whose_words_nobody_knows_the_one_that_somebody_writes_comes_first() -> None:
    for encoding, header in (("koi8-r", "Датчик;Образец"), ("cp850", "Größe;Höhe"), ("cp1252", "Größe;Höhe")):
        assert encoding_of(f"{header}\n1;2\n".encode(encoding))[0] == encoding


def test_bytes_of_no_text_have_no_encoding() -> None:
    assert encoding_of(bytes(range(128, 256)) + b"\n" + bytes(range(1, 9)))[0] == ""
