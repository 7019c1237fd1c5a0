"""Figures: what thinning keeps, what an SVG in a page must not contain, and that a picture is drawn at all."""

import re
from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from mock_devices.testing.made.synthetic import Bench
from rig.report.drawing import inline_svg, new_figure, png, speed_colors, svg, thinned
from rig.report.figures import Tracked, fit_figure, loop_figure, quantiles, residual_figure, tracking_figure
from rig.tissue.study import Study, study_curves
from rig.trials.curves import loading_curve


@pytest.fixture(scope="module")
def study() -> Study:
    """Two trials at two speeds."""
    cycles = Bench(rate_Hz=500.0).cycles(trials=2, speeds_mm_s=(5.0, 20.0))
    return study_curves("made", [loading_curve(cycle) for cycle in cycles])


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=3000), st.sampled_from([10, 160, 300]))
def test_thinning_keeps_extremes_order_and_few_points(values: list[float], points: int) -> None:
    y = np.array(values)
    x = np.arange(len(y), dtype=float)
    thin_x, thin_y = thinned(x, y, points)
    assert len(thin_x) <= points
    assert np.all(np.diff(thin_x) > 0)
    assert (thin_y.min(), thin_y.max()) == (y.min(), y.max())


def test_a_short_curve_is_left_alone() -> None:
    x = np.linspace(0, 1, 20)
    assert thinned(x, x**2)[1] == pytest.approx(x**2)


def test_speeds_go_from_light_to_dark_and_differ() -> None:
    for count in range(1, 6):
        assert len(set(speed_colors(count))) == count


@pytest.mark.parametrize("draw", [fit_figure, residual_figure])
def test_a_figure_of_a_study_is_a_picture_with_ink(study: Study, draw: Callable[[Study], Figure]) -> None:
    data = png(draw(study), dpi=60)
    assert data.startswith(b"\x89PNG")
    assert len(data) > 10_000


def test_the_fit_figure_shows_every_trial_and_both_models(study: Study) -> None:
    left, right = fit_figure(study).axes
    assert len([line for line in left.get_lines() if np.size(line.get_xdata()) > 50]) == len(study.curves) + 2
    labels = [text.get_text() for text in left.texts]
    assert {"constant", "index", "5 mm/s", "20 mm/s"} <= set(labels)
    assert (left.get_xlabel(), left.get_ylabel()) == ("displacement from contact, mm", "force, N")
    shown = max(float(np.max(line.get_ydata())) for line in right.get_lines())
    left_out = study.judged["constant"].trials_left_out
    assert left_out is not None
    assert shown == pytest.approx(max(study.judged["constant"].fitted.max_error_percent, left_out.max_error_percent))


def test_a_study_of_one_trial_is_drawn_without_left_out_errors() -> None:
    alone = study_curves("one", [loading_curve(Bench().cycle(10.0))])
    assert len(fit_figure(alone).axes[1].get_lines()) == 2


def test_tracking_shows_given_and_actual() -> None:
    time = np.linspace(0, 10, 5000)
    figure = tracking_figure(Tracked(time, np.full(5000, 2.0), 2.0 + 0.1 * np.sin(time)))
    above, below = figure.axes
    assert {text.get_text() for text in above.texts} == {"given", "actual"}
    assert float(np.max(np.abs(below.get_lines()[1].get_ydata()))) == pytest.approx(0.1, abs=0.001)


def test_the_loop_figure_counts_every_tick() -> None:
    wake, work = np.full(2000, 20.0), np.linspace(50, 900, 2000)
    left, _ = loop_figure(wake, work, 1000.0).axes
    bars = [patch for patch in left.patches if isinstance(patch, Rectangle)]
    assert sum(bar.get_height() for bar in bars) == pytest.approx(100.0)
    assert quantiles(work) == pytest.approx({"median": 475.0, "99 %": 891.5, "largest": 900.0}, rel=1e-3)


def test_an_svg_file_is_well_formed_and_draws_its_text_as_paths(study: Study) -> None:
    text = svg(fit_figure(study))
    ElementTree.fromstring(text)
    assert "<text" not in text
    assert "font-family" not in text


def test_an_inline_svg_stands_alone_in_a_page() -> None:
    figure = new_figure(3, 2)
    figure.subplots().plot([0, 1], [0, 1], color="#0072b2")
    text = inline_svg(figure, "first", 'a <line> & "more"')
    assert text.startswith('<svg role="img" aria-label="a &lt;line&gt; &amp; &quot;more&quot;"')
    assert "<metadata" not in text
    assert "var(--actual, #0072b2)" in text
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert ids
    assert all(name.startswith("first-") for name in ids)
    targets = re.findall(r'href="([^"]+)"|url\(([^)]+)\)', text)
    assert targets
    assert {one or two for one, two in targets} <= {f"#{name}" for name in ids}
