"""The picture of what came in: force over time and over depth of each recording, as it was understood."""

from collections.abc import Mapping, Sequence

import numpy as np

from rig.report.ink import ACTUAL, INK, MODEL, OTHER, SMALL_PT
from rig.report.panels import APART_PT, Box, Panel, picture, span, words
from rig.results.came_in import CameInResult, RecordingIn
from rig.results.came_in_trace import RecordingTrace

MOST = 27
WIDTH_PT = 864.0
# Side by side: two panels of a recording are then 6, 3 and 2 inches wide with their numbers.
BESIDE = ((1, 1), (8, 2), (MOST, 3))
ROW_PT, ALONE_PT = 140.0, 245.0
# Room for a line of the key above all, for a title, for numbers and names, and at the right.
HEAD_PT, TITLE_PT, FOOT_PT, LEFT_PT, RIGHT_PT = 14.0, 18.0, 31.0, 42.0, 9.0
# What of a name stands above two panels of 2 inches.
NAME_LETTERS = 34
LINE = f'stroke="{ACTUAL}" stroke-width="0.9" stroke-linejoin="round"'
KEY = "force is compression, position goes into the tissue; a line in orange: contact, with its interval; ×: none known"

Drawn = tuple[RecordingIn, RecordingTrace]


def came_in_figure(result: CameInResult, traces: Mapping[str, RecordingTrace]) -> str:
    """Two panels a recording as SVG, with a sentence on which they are where not all; empty where there is nothing."""
    shown, said = result.shown(MOST)
    drawn = [(about, traces[about.name]) for about in shown if about.streams and about.name in traces]
    if not drawn:
        return ""
    key = [said, _key(drawn)] if said else [_key(drawn)]
    beside = next(columns for most, columns in BESIDE if len(drawn) <= most)
    row_pt, head_pt = ALONE_PT if beside == 1 else ROW_PT, HEAD_PT * len(key) + 6
    wide_pt = WIDTH_PT / (2 * beside)
    size_pt = wide_pt - LEFT_PT - RIGHT_PT, row_pt - TITLE_PT - FOOT_PT
    parts = [words(line, (APART_PT, HEAD_PT * number)) for number, line in enumerate(key, 1)]
    for number, one in enumerate(drawn):
        row, place = divmod(number, beside)
        left_pt, top_pt = 2 * place * wide_pt + LEFT_PT, head_pt + row * row_pt + TITLE_PT
        parts += _over_time(Box(left_pt, top_pt, *size_pt), *one)
        parts += _over_depth(Box(left_pt + wide_pt, top_pt, *size_pt), *one)
    return picture(WIDTH_PT, head_pt + row_pt * -(-len(drawn) // beside), parts)


def _key(drawn: Sequence[Drawn]) -> str:
    full = "; dots: at the end of the range" * any(trace.full for _, trace in drawn)
    return KEY + full + "; grey bands: gaps" * any(trace.gaps_s for _, trace in drawn)


def _over_time(box: Box, about: RecordingIn, trace: RecordingTrace) -> list[str]:
    points, forced = trace.points, bool(np.isfinite(trace.points.force_N).any())
    value, name = (points.force_N, "compression, N →") if forced else (points.place_mm, "position, mm →")
    panel = Panel(box, span(points.time_s), span(value), ("time, s", name))
    for start_s, stop_s in trace.gaps_s:
        panel.band(start_s, stop_s, f'fill="{OTHER}" fill-opacity="0.6"')
    panel.line(points.time_s, value, LINE)
    panel.dots(trace.at_end.time_s, trace.at_end.force_N, MODEL)
    look = f'fill="{MODEL if about.quality == "bad" else INK}" font-weight="bold" font-size="{SMALL_PT}"'
    half, name = NAME_LETTERS // 2, about.name
    name = name if len(name) <= NAME_LETTERS else f"{name[: half - 1]}…{name[-half:]}"
    return [*panel.parts, words(f"{name}: {about.quality}", (box.left, box.top - APART_PT), look=look)]


def _over_depth(box: Box, about: RecordingIn, trace: RecordingTrace) -> list[str]:
    cycle = next((cycle for cycle in about.cycles if cycle.contact_mm is not None), None)
    points, at_end = trace.points, trace.at_end
    if not (np.isfinite(points.force_N) & np.isfinite(points.place_mm)).any():
        text = "no force" if np.isfinite(points.place_mm).any() else "no position"
        return [words(text, (box.left + box.width / 2, box.top + box.height / 2), "middle")]
    sense = -1.0 if cycle and "tension" in cycle.kind else 1.0
    surface_mm = (cycle.contact_mm if cycle else None) or 0.0
    edges_mm = [at for at in ((cycle.contact_low_mm, cycle.contact_high_mm) if cycle else ()) if at is not None]
    marks = np.array([at - surface_mm for at in ([surface_mm, *edges_mm] if cycle else ())])
    depth_mm, force_N = sense * points.place_mm - surface_mm, sense * points.force_N
    what = "position into the tissue" if cycle is None else "way in tension" if sense < 0 else "depth from contact"
    panel = Panel(box, span(depth_mm, marks), span(force_N), (f"{what}, mm →", ""))
    if cycle:
        panel.band(marks.min(), marks.max(), f'fill="{MODEL}" fill-opacity="0.22"')
        panel.band(0.0, 0.0, f'fill="{MODEL}"')
    panel.line(depth_mm, force_N, LINE)
    panel.dots(sense * at_end.place_mm - surface_mm, sense * at_end.force_N, MODEL)
    cross = [] if cycle else [words("×", (box.left + 3, box.top + SMALL_PT + 3), look=f'fill="{MODEL}" font-size="12"')]
    return [*panel.parts, *cross]
