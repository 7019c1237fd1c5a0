"""Results in tables and sentences: built once, with one header, for terminal and HTML alike."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from rig.results.base import known
from rig.results.fit import DisplacementErrors, FitResult, LatticeResult, LawResult
from rig.results.tracking import ComparedRun, Followed, SimulateResult, TrackingGain, TrackResult
from rig.tissue.rates import STUDY_B_N_S_MM
from rig.tissue.summary import ControlRow, RateTest

UNKNOWN = "–"


@dataclass(frozen=True)
class TextTable:
    """A table as text; the first ``words`` columns are names, the others numbers."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: int = 1


class Caution(str):
    """A sentence about what is not as it should be."""

    __slots__ = ()


Part = TextTable | str
"""What a person is shown of a result; sentences are plain text."""

Columns = Mapping[str, str]
"""A column each: its header, and the attribute of a row with its format, as in ``force_N:.2f``."""

SPEEDS = {
    "speed (mm/s)": "speed_mm_s:g", "trials": "trials:d", "largest depth (mm)": "max_depth_mm:.2f",
    "largest force (N)": "max_force_N:.2f",
}  # fmt: skip
SPRINGS = {
    "force (N)": "force_N:.2f", "depth (mm)": "depth_mm:.2f", "k exact (N/mm)": "k_exact_N_mm:.5f",
    "k by search (N/mm)": "k_loop_N_mm:.5f", "simulations": "simulations:d",
}  # fmt: skip
LEVELS = {
    "reference (N)": "given_N:.2f", "actual (N)": "actual_N:.3f", "error (N)": "error_N:+.3f",
    "error (%)": "error_percent:+.2f", "largest error (N)": "max_error_N:.3f", "rms error (N)": "rms_error_N:.4f",
    "overshoot (%)": "overshoot_percent:.1f", "settling (s)": "settling_s:.2f",
}  # fmt: skip
WORST = {
    "error (N)": "error_N:.4f", "error (%)": "error_percent:.2f", "largest (N)": "largest_error_N:.3f",
    "overshoot (%)": "overshoot_percent:.1f", "settling (s)": "settling_s:.2f",
}  # fmt: skip
STUDY = {
    "given (N)": "given_N:.2f", "actual (N)": "actual_N:.3f", "error (N)": "error_N:+.3f",
    "error (%)": "error_percent:+.2f", "position error (mm)": "position_error_mm:.3f",
}  # fmt: skip
MARGINS = {
    "N": "force_N:.2f", "N/mm": "tangent_N_mm:.2f", "crossover Hz": "crossover_Hz:.1f",
    "phase deg": "phase_deg:.0f", "gain": "gain:.1f", "worst deg": "worst_phase_deg:.0f",
    "worst gain": "worst_gain:.1f", "stable to N/mm": "stiffest_N_mm:.1f",
}  # fmt: skip


def render(value: float | None, form: str) -> str:
    """The number in that format; a dash where it is unknown."""
    return UNKNOWN if known(value) is None else format(value, form)


def cells(row: object, columns: Columns) -> list[str]:
    """The row's text in each column."""
    return [render(getattr(row, name), form) for name, _, form in (text.partition(":") for text in columns.values())]


def numbers(title: str, columns: Columns, rows: Iterable[object]) -> TextTable:
    """A table of numbers alone."""
    return TextTable(title, list(columns), [cells(row, columns) for row in rows], words=0)


def fit_parts(result: FitResult) -> Iterator[Part]:
    """All of a fit, two laws side by side: what 80 columns take."""
    yield from curve_parts(result)
    yield from law_parts(result, 2)
    if result.lattice:
        yield from lattice_parts(result.lattice)


def curve_parts(result: FitResult) -> Iterator[Part]:
    """What was measured, and what of it could not be used."""
    yield numbers("Loading curves", SPEEDS, result.speeds)
    if result.rate:
        yield rate_sentence(result.rate)
    yield from (Caution(f"not used: {one.trial}: {one.reason}") for one in result.skipped)
    yield from (Caution(finding.sentence) for finding in result.data_quality)
    yield from result.remarks


def law_parts(result: FitResult, beside: int) -> Iterator[Part]:
    """How wrong each law is, ``beside`` of them side by side, its parameters, and what it means to a force loop."""
    names = list(result.laws)
    yield errors_table(result.laws)
    for at in range(0, len(names), beside):
        yield displacement_table(result, names[at : at + beside])
    yield parameter_table(result.laws)
    yield control_table(result.laws[result.model_law].control, result.model_law)


def lattice_parts(found: LatticeResult) -> Iterator[Part]:
    """The lattice: spring by spring, and as a law among others."""
    yield numbers(f"Spring stiffness per force, {' x '.join(map(str, found.vertices))} vertices", SPRINGS, found.points)
    yield from lattice_sentences(found)
    yield errors_table(found.models)
    yield control_table(found.models["lattice index"].control, "lattice index")


def track_parts(result: TrackResult) -> Iterator[Part]:
    """A tracking run, level by level and as a whole."""
    if result.levels:
        yield numbers("Reference and actual force on each level", LEVELS, result.levels)
    yield followed_sentence(result.followed)
    if result.gain and result.against:
        yield gain_sentence(result.gain, result.against.model, result.model)


def displacement_table(fit: FitResult, names: Sequence[str]) -> TextTable:
    """Displacement at given forces, measured and by each law, and the worst trial's error."""
    header = ["force (N)", "measured (mm)"]
    for name in names:
        header += [name, "error (mm)", "error (%)"]
    rows = []
    for at, first in enumerate(fit.laws[names[0]].rows):
        row = [f"{first.force_N:.2f}", f"{first.measured_mm:.2f}"]
        for found in (fit.laws[name].rows[at] for name in names):
            row += [f"{found.predicted_mm:.2f}", f"{found.error_mm:.3f}", render(found.error_percent, ".1f")]
        rows.append(row)
    return TextTable("Displacement in mm at given forces, and the worst trial's error", header, rows, words=0)


def errors_table(laws: Mapping[str, LawResult]) -> TextTable:
    """Worst errors of each law compared."""
    kinds = {"trials": "left-out trials", "speeds": "left-out speeds"}
    if any(law.held_out.subjects for law in laws.values()):
        kinds["subjects"] = "left-out subjects"
    rows = [
        [name, _worst(law), *(_worst(getattr(law.held_out, kind)) for kind in kinds), f"{law.rmse_N:.3f}"]
        for name, law in laws.items()
    ]
    title = "Worst errors of displacement in mm (%), on what was fitted and on what was left out"
    return TextTable(title, ["law", "fitted", *kinds.values(), "residual (N rms)"], rows)


def _worst(errors: DisplacementErrors | None) -> str:
    return f"{render(errors.max_error_mm, '.3f')} ({render(errors.max_error_percent, '.1f')})" if errors else UNKNOWN


def parameter_table(laws: Mapping[str, LawResult]) -> TextTable:
    """Parameters with their intervals; of one that was given, or stopped by a bound, that is said instead."""
    rows = []
    for name, law in laws.items():
        for parameter, found in law.parameters.items():
            low, high = found.interval
            interval = "known" if found.known else "at its bound" if found.at_bound else f"{low:.4g} to {high:.4g}"
            rows.append((name, parameter, f"{found.value:.4g}", interval, found.unit))
    methods = ", ".join(dict.fromkeys(law.interval_method for law in laws.values()))
    return TextTable(f"Parameters ({methods})", ("law", "parameter", "value", "95 % interval", "unit"), rows, words=2)


def control_table(control: Sequence[ControlRow], law: str) -> TextTable:
    """K and B at each force, as a force loop needs them."""
    rows = [
        (
            f"{r.force_N:.2f}", f"{r.depth_mm:.2f}", f"{r.secant_N_mm:.4g}", f"{r.tangent_N_mm:.4g}",
            f"{r.tangent_low_N_mm:.4g} to {r.tangent_high_N_mm:.4g}", f"{r.damping_N_s_mm:.4g}",
            f"{r.damping_low_N_s_mm:.4g} to {r.damping_high_N_s_mm:.4g}",
        )
        for r in control
    ]  # fmt: skip
    header = ("force (N)", "depth (mm)", "secant (N/mm)", "tangent (N/mm)", "95 %", "B (N s/mm)", "95 %")
    return TextTable(f"K and B for control ({law})", header, rows, words=0)


def rate_sentence(rate: RateTest) -> str:
    """What the comparison of speeds found, and what it says of the study's B."""
    low, high = rate.effect_interval_N
    return (
        f"speed: B = {rate.damping_N_s_mm:.4g} N s/mm (95 %: {rate.interval[0]:.4g} to {rate.interval[1]:.4g}, "
        f"p = {rate.p_value:.3g}, {rate.trials} trials); slowest to fastest {rate.effect_N:.3g} N ({low:.3g} to "
        f"{high:.3g} N), scatter of trials {rate.spread_N:.2g} N; the study's {STUDY_B_N_S_MM:g} N s/mm would be "
        f"{rate.study_effect_N:.3g} N: {'excluded' if rate.excludes_study else 'not excluded'}"
    )


def lattice_sentences(found: LatticeResult) -> Iterator[str]:
    """The index law through the springs, where the block collapses, and the fit spring by spring."""
    fit = found.index
    (a_low, a_high), (b_low, b_high) = fit.a_interval, fit.b_interval
    yield (
        f"k(x) = {fit.a_N_mm:.4g} exp({fit.b_per_mm:.4g} x) N/mm; 95 %: a {a_low:.4g} to {a_high:.4g}, "
        f"b {b_low:.4g} to {b_high:.4g}; R2 {fit.r_squared:.4f}"
    )
    if found.collapse:
        yield f"the lattice collapses: {found.collapse}"
    own = found.per_spring
    if own is not None:
        values = [
            f"{name} = {p.value:.4g} {p.unit} ({p.interval[0]:.4g} to {p.interval[1]:.4g})"
            for name, p in found.models[own.law].parameters.items()
        ]
        check = own.doubt or f"the whole block agrees with its quarter to {own.agrees_to_mm:.3g} mm"
        yield f"spring by spring: {', '.join(values)}; {check}"


def followed_sentence(whole: Followed) -> str:
    """The whole run in one line, for references that do not rest."""
    moving = (
        ""
        if whole.amplitude_ratio is None or whole.lag_s is None
        else f", amplitude {100 * whole.amplitude_ratio:.1f} % of the reference, {1000 * whole.lag_s:.0f} ms late"
    )
    return f"error of the whole run: rms {whole.rms_error_N:.3f} N, largest {whole.largest_error_N:.3f} N{moving}"


def gain_sentence(gain: TrackingGain, before: str, after: str) -> str:
    """What tracking with the model ``after`` gains over tracking with ``before``."""
    return (
        f"rms error over the whole run: {gain.rms_error_before_N:.4f} N with {before}, "
        f"{gain.rms_error_after_N:.4f} N with {after} ({100 * gain.reduction:+.0f} % less)"
    )


def run_table(runs: Sequence[ComparedRun], reference: str = "") -> TextTable:
    """The worst jump on each subject."""
    rows = [[run.subject, *cells(run.worst, WORST)] for run in runs]
    return TextTable(f"Worst of {reference}; overshoot of the jump", ["subject", *WORST], rows)


def study_table(runs: Sequence[ComparedRun]) -> TextTable:
    """Given and actual force on each subject, as the study has them."""
    rows = [[run.subject, *cells(level, STUDY)] for run in runs for level in run.levels]
    return TextTable("Given and actual force, and what that is in position", ["subject", *STUDY], rows)


def simulation_parts(found: SimulateResult) -> Iterator[Part]:
    """The simulation: how stable, how well, how fast."""
    yield numbers("Stability margins of the force loop", MARGINS, found.margins)
    reach = found.reach
    yield (
        f"crossover {reach.crossover_Hz:.1f} Hz, two leads of {reach.lead_ms:.1f} ms, second integral from"
        f" {reach.drift_Hz:.1f} Hz; of a limb's motion at 1 Hz {100 * reach.left_of_motion:.1f} % is left in the force,"
        f" of the sensor's noise {100 * reach.noise_share:.0f} %"
    )
    yield (
        f"{found.reference}: rms error {found.rms_error_N:.3f} N, peak {found.peak_force_N:.2f} N,"
        f" {found.times_real_time:.0f} times real time"
    )
