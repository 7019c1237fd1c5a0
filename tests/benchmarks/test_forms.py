"""The generator of other forms: it shares nothing with what it tries, and its physics are those of the literature."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.forms import bench, tissue
from benchmarks.forms.draw import LAWS, PARTS, ROTATION, draw
from benchmarks.forms.noise import NOISES
from benchmarks.forms.session import GRID_S, STEP_S, record
from rig.diagnosis.effects.registry import CAUSES

FOLDER = Path(bench.__file__).parent
SEVERAL = range(40)
VOCABULARY = {cause.name for cause in CAUSES.values()}
SIZES = {par.name for cause in CAUSES.values() for par in cause.pars} | {"ripple_mm", "surface_motion_mm", "cogging_N"}


def imports(path: Path) -> set[str]:
    nodes = list(ast.walk(ast.parse(path.read_text())))
    plain = {name.name for node in nodes if isinstance(node, ast.Import) for name in node.names}
    return plain | {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}


def test_it_imports_nothing_of_what_it_tries() -> None:
    libraries = {"ast", "collections", "dataclasses", "functools", "itertools", "numpy", "scipy", "typing"}
    found = {module for path in FOLDER.glob("*.py") for module in imports(path)}
    assert {module for module in found if module.split(".")[0] not in libraries} <= {
        "benchmarks.forms" + end for end in ("", ".bench", ".noise", ".session", ".tissue")
    }


def test_what_is_true_is_said_in_the_words_of_the_library() -> None:
    parts = [make(np.random.default_rng(1)) for makers in PARTS.values() for make in makers]
    parts += [make(np.random.default_rng(1))[0] for make in LAWS.values()]
    assert {name for part in parts for name in part.names} <= VOCABULARY
    assert {name for part in parts for name in part.sizes} <= SIZES
    assert all(not part.names for part in parts if part.name in ("slips", "muscle that tenses"))


def test_every_kind_every_part_and_every_noise_is_drawn() -> None:
    drawn = [draw(seed) for seed in range(400)]
    assert {one.kind for one in drawn} == set(ROTATION)
    assert {one.noise for one in drawn} == {*NOISES, "quantised"}
    assert {one.bench.rate_Hz for one in drawn} == {100.0, 1000.0}
    names = {part.name for one in drawn for part in one.hidden}
    assert len(names) == len(LAWS) - 1 + sum(map(len, PARTS.values())) + 1  # Dahl comes with two exponents
    assert all(not one.hidden for one in drawn if one.kind == "clean")


X = np.array([1e-6, 1.0, 4.0])


def test_elastic_laws_begin_as_their_limits_do() -> None:
    assert tissue.fung(0.2, 0.4)(X)[0] == pytest.approx(0.2e-6, rel=1e-5)
    assert tissue.ogden_block(0.2, 20.0, 6.0)(X)[0] == pytest.approx(0.2e-6, rel=1e-5)
    hertz = 16 / 9 * 0.03 * np.sqrt(8.0) * X**1.5
    assert tissue.thin_layer(0.03, 8.0, 1e6)(X) == pytest.approx(hertz, rel=1e-4)
    assert np.all(tissue.thin_layer(0.03, 8.0, 15.0)(X[1:]) > 1.2 * hertz[1:])
    sphere = tissue.neo_hookean_sphere(0.1, 10.0)
    # Lin and others (2009) write B (a^5 - 15 R a^4 + 75 R^2 a^3) / (5 R a^2 - 50 R^2 a + 125 R^3).
    a, r = np.sqrt(10.0 * X), 10.0
    written = (a**5 - 15 * r * a**4 + 75 * r**2 * a**3) / (5 * r * a**2 - 50 * r**2 * a + 125 * r**3)
    assert sphere(X) == pytest.approx(0.1 * written)


def test_a_prony_series_on_a_ramp_is_its_closed_form_and_any_kernel_agrees_with_it() -> None:
    time_s = np.arange(4000) * STEP_S
    ramp = np.minimum(time_s, 1.0)[:, None] * 3.0
    found = tissue.remember_exponentials(ramp, STEP_S, [0.3, 0.2], [0.1, 0.8])[:, 0]
    rising = time_s <= 1.0
    expected = ramp[:, 0] + sum(
        3.0 * g * tau * np.where(rising, 1 - np.exp(-time_s / tau), (np.exp(1 / tau) - 1) * np.exp(-time_s / tau))
        for g, tau in ((0.3, 0.1), (0.2, 0.8))
    )
    assert found == pytest.approx(expected, abs=1e-9)
    kernel = tissue.remember(ramp, STEP_S, lambda t: 0.3 * np.exp(-t / 0.1) + 0.2 * np.exp(-t / 0.8))[:, 0]
    assert kernel == pytest.approx(expected, abs=1e-4)


def test_memory_of_a_step_is_its_kernel() -> None:
    step = np.ones((1000, 1))
    step[0] = 0
    since_s = (np.arange(999, dtype=np.float64) + 0.5) * STEP_S
    for kernel in (tissue.power_law(0.5, 0.02, 0.3), tissue.poroelastic(0.4, 1.0)):
        assert tissue.remember(step, STEP_S, kernel)[1:, 0] - 1 == pytest.approx(kernel(since_s))
    assert tissue.poroelastic(1.0, 1.0)(np.array([0.0])) == pytest.approx(1.0)
    assert tissue.power_law(0.5, 0.02, 0.3)(np.array([0.0])) == pytest.approx(0.5)


def test_softening_leaves_first_loading_alone_and_lasts_on_its_site() -> None:
    law = tissue.fung(0.2, 0.4)
    depth = np.concatenate([np.linspace(0, 5, 200), np.linspace(5, 0, 200)])[:, None].repeat(3, axis=1)
    site = np.array([0, 0, 1])
    softer = tissue.soften_by_energy(law(depth), depth, site, law, r=2.0, m=0.5)
    assert softer[:200, [0, 2]] == pytest.approx(law(depth)[:200, [0, 2]])
    assert np.all(softer[100:190, 1] < 0.95 * law(depth)[100:190, 1])
    assert softer[200:, 0] == pytest.approx(softer[200:, 1])
    assert tissue.counts_on_site(np.array([0, 1, 0, 0, 1])).tolist() == [0, 0, 1, 2, 1]


@pytest.mark.parametrize("speed", [1.0, 4.0, 20.0])
def test_friction_slides_on_stribecks_curve_and_at_coulombs_level(speed: float) -> None:
    way = np.concatenate([np.full(8000, speed), np.full(8000, -speed)])[:, None]
    force = bench.lugre(way, STEP_S, 0.2, 0.3, 4.0, 0.1)
    level = 0.2 + 0.1 * np.exp(-((speed / 4.0) ** 2))
    assert (force[7999, 0], force[-1, 0]) == (pytest.approx(level), pytest.approx(-level))
    place = np.cumsum(way, axis=0) * STEP_S
    for exponent in (0.5, 1.5):
        dahl = bench.dahl(place, 0.2, 0.1, exponent)
        assert (dahl[7999, 0], dahl[-1, 0]) == (pytest.approx(0.2, rel=0.01), pytest.approx(-0.2, rel=0.01))
    # dF/dx = Fc/l (1 - F/Fc)^i from -Fc on, for i = 1/2: sqrt(2) - x/(2 l) squared is what is left of 2 Fc.
    part = bench.dahl(np.linspace(0, 0.1, 400, dtype=np.float64)[:, None], 1.0, 0.1, 0.5)
    assert part[-1, 0] == pytest.approx(1 - (np.sqrt(2) - 0.5) ** 2, abs=1e-3)


def test_lost_motion_is_its_width_and_builds_up_over_half_of_it_more() -> None:
    place = np.concatenate([np.linspace(0, 3, 600), np.linspace(3, 0, 600)])[:, None]
    behind = bench.lost_motion(place, 0.4) - place
    assert behind[:600] == pytest.approx(0.0)
    assert behind[-1, 0] == pytest.approx(0.4)
    at = np.argmin(np.abs(place[600:, 0] - (3 - 0.4))) + 600
    assert 0.3 < behind[at, 0] < 0.4  # a single play would have its whole width here


def test_a_sensor_with_hysteresis_reads_true_on_the_way_up() -> None:
    force = np.concatenate([np.linspace(0, 4, 400), np.linspace(4, 0, 400)])[:, None]
    read = bench.sensor_hysteresis(force, 0.2, 0.5)
    assert read[:400] == pytest.approx(force[:400])
    assert read[-1, 0] == pytest.approx(0.2 * 0.5)


def test_a_tip_that_slips_carries_less_from_there_on_in_some_strokes() -> None:
    depth_mm = np.concatenate([np.linspace(0, 5, 200), np.linspace(5, 0, 200)])[:, None].repeat(40, axis=1)
    share = bench.slipped(np.ones_like(depth_mm), depth_mm, np.random.default_rng(3), 0.2)
    assert np.all(share[depth_mm[:, 0] < 0.4 * 5 - 0.1][:50] == 1.0)
    assert set(np.unique(share[-1].round(12))) == {0.8, 1.0}
    assert np.all(np.diff(share, axis=0) <= 0)


def test_breath_has_no_period_and_tremor_its_size() -> None:
    time_s = np.arange(0, 120, 0.01)[:, None]
    chest = bench.breath(time_s, np.random.default_rng(2), 0.3, 4.0)[:, 0]
    tops = np.flatnonzero((chest[1:-1] > chest[:-2]) & (chest[1:-1] >= chest[2:])) + 1
    periods = np.diff(time_s[tops, 0])
    assert periods.mean() == pytest.approx(4.0, rel=0.1) and periods.std() > 0.3
    assert np.std(chest[tops]) > 0.03
    shaking = bench.tremor(time_s, np.random.default_rng(2), 0.1)
    assert shaking.std() == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize("name", ["white", "coloured", "heavy-tailed"])
def test_noise_is_as_large_as_it_says(name: str) -> None:
    made = [NOISES[name](np.random.default_rng(seed), 4000, 0.005).std() for seed in range(20)]
    assert np.mean(made) == pytest.approx(0.005, rel=0.1)


def test_the_stated_noise_of_a_session_is_that_of_its_means() -> None:
    drawn = draw(0)
    plain = replace(drawn.bench, noise=NOISES["white"], noise_N=0.006, step_N=1e-6, rate_Hz=1000.0)
    found = record(plain, (), np.random.default_rng(1)).noise_N
    assert found == pytest.approx(0.006 / np.sqrt(GRID_S * 1000), rel=0.03)


@pytest.mark.parametrize("seed", [seed for seed in SEVERAL if ROTATION[seed % len(ROTATION)] == "outside"])
def test_what_is_outside_is_far_above_the_noise(seed: int) -> None:
    drawn = draw(seed)
    quiet = replace(drawn.bench, noise_N=1e-9, step_N=1e-9, noise=NOISES["white"])
    with_it, without = (record(quiet, parts, np.random.default_rng(seed)) for parts in (drawn.parts, ()))
    pairs = zip(with_it.recordings, without.recordings, strict=True)
    apart = np.concatenate([(a.force_N - b.force_N) - np.mean(a.force_N - b.force_N) for a, b in pairs])
    assert apart.std() > 4 * drawn.record().noise_N


def test_a_session_holds_sites_speeds_and_repeats_each_from_the_air() -> None:
    drawn = draw(9)
    made = drawn.record()
    assert len(made.recordings) in (8, 12)
    speeds, counts = np.unique([one.speed_mm_s for one in made.recordings], return_counts=True)
    assert len(speeds) in (3, 4) and set(counts) <= {2, 4}
    for one in made.recordings:
        rest = one.force_N[: round(0.2 * drawn.bench.rate_Hz)]
        assert rest.std() < 0.05 and one.force_N.max() - rest.mean() > 0.4
        fastest = np.max(np.abs(np.diff(one.axis_mm))) * drawn.bench.rate_Hz
        assert fastest == pytest.approx(max(one.speed_mm_s, drawn.bench.retract_mm_s), rel=0.05)
