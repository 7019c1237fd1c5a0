"""Tables of results: built once, with one header, for terminal and HTML alike."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rig.results.fit import DisplacementErrors, FitResult, LatticeModel, LatticeResult, LawResult, RateResult
from rig.results.tracking import ComparedRun, Followed, LoopMargins, Plateau, SimulateResult, TrackResult
from rig.tissue.rates import STUDY_B_N_S_MM
from rig.tissue.summary import ControlRow, SpeedSummary

UNKNOWN = "–"


@dataclass(frozen=True)
class TextTable:
    """A table as text; the first ``words`` columns are names, the others numbers."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: int = 1


def shown(value: float | None, form: str) -> str:
    """The number in that format; a dash where it is unknown."""
    return UNKNOWN if value is None else format(value, form)


def speed_table(speeds: Sequence[SpeedSummary]) -> TextTable:
    """What was measured at each speed."""
    header = ("speed (mm/s)", "trials", "largest depth (mm)", "largest force (N)")
    rows = [(f"{s.speed_mm_s:g}", f"{s.trials}", f"{s.max_depth_mm:.2f}", f"{s.max_force_N:.2f}") for s in speeds]
    return TextTable("Loading curves", header, rows, words=0)


def displacement_table(fit: FitResult, names: Sequence[str]) -> TextTable:
    """Displacement at given forces, measured and by each law, and the worst trial's error."""
    header = ["force (N)", "measured (mm)"]
    for name in names:
        header += [name, "error (mm)", "error (%)"]
    rows = []
    for at, first in enumerate(fit.laws[names[0]].rows):
        cells = [f"{first.force_N:.2f}", f"{first.measured_mm:.2f}"]
        for row in (fit.laws[name].rows[at] for name in names):
            cells += [f"{row.predicted_mm:.2f}", f"{row.error_mm:.3f}", shown(row.error_percent, ".1f")]
        rows.append(cells)
    return TextTable("Displacement in mm at given forces, and the worst trial's error", header, rows, words=0)


def law_errors_table(laws: Mapping[str, LawResult]) -> TextTable:
    """Worst errors of each law compared."""
    return _errors_table(
        {name: (law, law.held_out.trials, law.held_out.speeds, law.held_out.subjects) for name, law in laws.items()}
    )


def lattice_errors_table(models: Mapping[str, LatticeModel]) -> TextTable:
    """Worst errors of the lattice's laws and of the laws compared with them."""
    return _errors_table(
        {
            name: (model.fitted, model.trials_left_out, model.speeds_left_out, model.subjects_left_out)
            for name, model in models.items()
        }
    )


def _errors_table(found: Mapping[str, tuple[DisplacementErrors | None, ...]]) -> TextTable:
    header = ["law", "fitted", "left-out trials", "left-out speeds", "left-out subjects", "residual (N rms)"]
    several = any(errors[3] for errors in found.values())
    kept = [0, 1, 2, 3] if several else [0, 1, 2]
    rows = [
        [name, *(_worst(errors[at]) for at in kept), f"{errors[0].rmse_N:.3f}" if errors[0] else UNKNOWN]
        for name, errors in found.items()
    ]
    title = "Worst errors of displacement in mm (%), on what was fitted and on what was left out"
    return TextTable(title, header if several else header[:4] + header[5:], rows)


def _worst(errors: DisplacementErrors | None) -> str:
    return f"{shown(errors.max_error_mm, '.3f')} ({shown(errors.max_error_percent, '.1f')})" if errors else UNKNOWN


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
            f"{r.force_N:.2f}", f"{r.depth_mm:.2f}", f"{r.secant_N_mm:.3f}", f"{r.tangent_N_mm:.3f}",
            f"{r.tangent_low_N_mm:.3f}-{r.tangent_high_N_mm:.3f}", f"{r.damping_N_s_mm:.4f}",
            f"{r.damping_low_N_s_mm:.4f}-{r.damping_high_N_s_mm:.4f}",
        )
        for r in control
    ]  # fmt: skip
    header = ("force (N)", "depth (mm)", "secant (N/mm)", "tangent (N/mm)", "95 %", "B (N s/mm)", "95 %")
    return TextTable(f"K and B for control ({law})", header, rows, words=0)


def rate_sentence(rate: RateResult) -> str:
    """What the comparison of speeds found, and what it says of the study's B."""
    low, high = rate.effect_interval_N
    return (
        f"speed: B = {rate.damping_N_s_mm:.4g} N s/mm (95 %: {rate.interval[0]:.4g} to {rate.interval[1]:.4g}, "
        f"p = {rate.p_value:.3g}, {rate.trials} trials); slowest to fastest {rate.effect_N:.3g} N ({low:.3g} to "
        f"{high:.3g} N), scatter of trials {rate.spread_N:.2g} N; the study's {STUDY_B_N_S_MM:g} N s/mm would be "
        f"{rate.study_effect_N:.3g} N: {'excluded' if rate.excludes_study else 'not excluded'}"
    )


def spring_table(found: LatticeResult) -> TextTable:
    """Spring stiffness at each given force, exact and by the study's search."""
    header = ("force (N)", "depth (mm)", "k exact (N/mm)", "k by search (N/mm)", "simulations")
    rows = [
        (
            f"{p.force_N:.2f}", f"{p.depth_mm:.2f}", f"{p.k_exact_N_mm:.5f}",
            shown(p.k_loop_N_mm, ".5f"), f"{p.simulations}",
        )
        for p in found.points
    ]  # fmt: skip
    return TextTable(f"Spring stiffness per force, {' x '.join(map(str, found.vertices))} vertices", header, rows, 0)


def lattice_sentences(found: LatticeResult) -> list[str]:
    """The index law through the springs, where the block collapses, and the fit spring by spring."""
    fit = found.index
    (a_low, a_high), (b_low, b_high) = fit.a_interval, fit.b_interval
    said = [
        f"k(x) = {fit.a_N_mm:.4g} exp({fit.b_per_mm:.4g} x) N/mm; 95 %: a {a_low:.4g} to {a_high:.4g}, "
        f"b {b_low:.4g} to {b_high:.4g}; R2 {fit.r_squared:.4f}"
    ]
    if found.collapse:
        said.append(f"the lattice collapses: {found.collapse}")
    own = found.per_spring
    if own is not None:
        model = found.models[own.law]
        values = [
            f"{name} = {value:.4g} {model.units[name]} ({low:.4g} to {high:.4g})"
            for (name, value), (low, high) in zip(model.parameters.items(), model.intervals.values(), strict=True)
        ]
        check = own.doubt or f"the whole block agrees with its quarter to {own.agrees_to_mm:.3g} mm"
        said.append(f"spring by spring: {', '.join(values)}; {check}")
    return said


def level_table(levels: Sequence[Plateau]) -> TextTable:
    """Reference and actual force on each level of a tracking run."""
    header = (
        "reference (N)", "actual (N)", "error (N)", "error (%)", "largest error (N)", "rms error (N)",
        "overshoot (%)", "settling (s)",
    )  # fmt: skip
    rows = [
        (
            f"{level.given_N:.2f}", f"{level.actual_N:.3f}", f"{level.error_N:+.3f}", f"{level.error_percent:+.2f}",
            f"{level.max_error_N:.3f}", f"{level.rms_error_N:.4f}", f"{level.overshoot_percent:.1f}",
            shown(level.settling_s, ".2f"),
        )
        for level in levels
    ]  # fmt: skip
    return TextTable("Reference and actual force on each level", header, rows, words=0)


def followed_sentence(whole: Followed) -> str:
    """The whole run in one line, for references that do not rest."""
    moving = (
        ""
        if whole.amplitude_ratio is None or whole.lag_s is None
        else f", amplitude {100 * whole.amplitude_ratio:.1f} % of the reference, {1000 * whole.lag_s:.0f} ms late"
    )
    return f"error of the whole run: rms {whole.rms_error_N:.3f} N, largest {whole.largest_error_N:.3f} N{moving}"


def gain_sentence(result: TrackResult) -> str:
    """What the model tracked with gains over the one tracked with before; empty where there was one run only."""
    if result.against is None or result.gain is None:
        return ""
    gain = result.gain
    return (
        f"rms error over the whole run: {gain.rms_error_before_N:.4f} N with {result.against.model}, "
        f"{gain.rms_error_after_N:.4f} N with {result.model} ({100 * gain.reduction:+.0f} % less)"
    )


def run_table(runs: Sequence[ComparedRun], reference: str = "") -> TextTable:
    """The worst jump of each choice of gains on each subject."""
    header = ("subject", "gains", "error (N)", "error (%)", "largest (N)", "overshoot (%)", "settling (s)")
    rows = [
        (
            run.subject, run.gains, shown(run.worst.error_N, ".4f"), shown(run.worst.error_percent, ".2f"),
            shown(run.worst.largest_error_N, ".3f"), shown(run.worst.overshoot_percent, ".1f"),
            shown(run.worst.settling_s, ".2f"),
        )
        for run in runs
    ]  # fmt: skip
    return TextTable(f"Worst of {reference}; overshoot of the jump", header, rows, words=2)


def margin_table(margins: Sequence[LoopMargins]) -> TextTable:
    """Stability margins at each force."""
    header = ("force (N)", "tangent (N/mm)", "crossover (Hz)", "phase margin (deg)", "gain margin")
    rows = [
        (f"{m.force_N:.2f}", f"{m.tangent_N_mm:.2f}", f"{m.crossover_Hz:.1f}", f"{m.phase_deg:.0f}", f"{m.gain:.1f}")
        for m in margins
    ]
    return TextTable("Stability margins of the force loop", header, rows, words=0)


def simulation_sentence(found: SimulateResult) -> str:
    """The simulation in one line."""
    return (
        f"{found.reference}: rms error {found.rms_error_N:.3f} N, peak {found.peak_force_N:.2f} N,"
        f" {found.times_real_time:.0f} times real time"
    )
