"""Small pieces of HTML. Every text that comes from outside passes through ``text``; pieces are joined, never parsed."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape

from rig.results.tables import Caution, Part, TextTable


def text(value: object) -> str:
    """``value`` as harmless text."""
    return escape(str(value))


def paragraph(value: object, kind: str = "") -> str:
    """A paragraph of plain text."""
    return f"<p{_class(kind)}>{text(value)}</p>"


def section(title: str, *pieces: str) -> str:
    """A titled part of the page."""
    return f"<section><h2>{text(title)}</h2>{''.join(pieces)}</section>"


def cards(values: Iterable[tuple[str, str, str]]) -> str:
    """Key figures: (number, what it is, note)."""
    items = "".join(
        f'<div class="card"><b>{text(number)}</b><span>{text(what)}</span><small>{text(note)}</small></div>'
        for number, what, note in values
    )
    return f'<div class="cards">{items}</div>'


def table(shown: TextTable) -> str:
    """A table; what is not in its first columns of words stands to the right, as numbers do."""
    kinds = ["" if column < shown.words else "number" for column in range(len(shown.header))]
    head = _cells("th", shown.header, kinds)
    body = "".join(f"<tr>{_cells('td', row, kinds)}</tr>" for row in shown.rows)
    title = f"<caption>{text(shown.title)}</caption>" if shown.title else ""
    return f'<div class="table"><table>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def _cells(tag: str, cells: Sequence[str], kinds: Sequence[str]) -> str:
    return "".join(f"<{tag}{_class(kind)}>{text(cell)}</{tag}>" for cell, kind in zip(cells, kinds, strict=True))


def parts(found: Iterable[Part]) -> str:
    """Tables and sentences of a result, as they come."""
    return "".join(
        table(part) if isinstance(part, TextTable) else paragraph(part, "warning" * isinstance(part, Caution))
        for part in found
    )


def pairs(values: Mapping[str, object]) -> str:
    """Names and values."""
    return "<dl>" + "".join(f"<dt>{text(name)}</dt><dd>{text(value)}</dd>" for name, value in values.items()) + "</dl>"


def figure(svg: str, caption: str) -> str:
    """A picture (already markup) and the sentence below it."""
    return f"<figure>{svg}<figcaption>{text(caption)}</figcaption></figure>"


def details(summary: str, *pieces: str) -> str:
    """A part that is folded away on the screen."""
    return f"<details><summary>{text(summary)}</summary>{''.join(pieces)}</details>"


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""
