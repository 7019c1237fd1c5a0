"""What a page loads from elsewhere is found wherever it can stand; links to follow are left alone."""

from pathlib import Path

import pytest

from tools.offline import look

FETCHES = {
    "script.html": '<script src="https://cdn.example.org/mathjax.js"></script>',
    "style.html": '<link rel="stylesheet" href="//fonts.example.org/css?family=Lato">',
    "icon.html": '<link href="http://example.org/icon.png" rel="shortcut icon">',
    "picture.html": '<img alt="" src=" https://example.org/badge.svg">',
    "sizes.html": '<img alt="" src="a.png" srcset="a.png 1x, https://example.org/b.png 2x">',
    "frame.html": '<iframe src="https://example.org/video"></iframe>',
    "inline.html": "<style>@import 'https://example.org/a.css';</style>",
    "attribute.html": '<p style="background: url(https://example.org/a.png)">text</p>',
    "call.html": '<script>fetch("https://example.org/version.json")</script>',
    "font.css": '@font-face { src: url("https://example.org/a.woff2") }',
    "module.js": "const math = await import('https://example.org/math.js')",
    "request.js": 'request.open("GET", "https://example.org/switcher.json")',
}
STAYS = {
    "link.html": '<a href="https://example.org/spec">the specification</a>',
    "canonical.html": '<link rel="canonical" href="https://example.org/">',
    "own.html": '<link rel="stylesheet" href="_static/a.css"><script src="_static/a.js"></script>',
    "namespace.svg": '<svg xmlns="http://www.w3.org/2000/svg"/>',
    "comment.js": "/* see https://example.org/licence */ fetch('own.json')",
    "font.css": "@font-face { src: url(../fonts/a.woff2) }",
}


@pytest.mark.parametrize("name", FETCHES)
def test_what_is_fetched_from_another_host_is_named(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(FETCHES[name])
    (line,) = look(tmp_path)
    assert name in line
    assert "example.org" in line


@pytest.mark.parametrize("name", STAYS)
def test_what_is_at_hand_or_only_linked_is_not(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(STAYS[name])
    assert not list(look(tmp_path))
