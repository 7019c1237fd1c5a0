"""Law and constant on the mock bench: that the same is played and judged there, and what is no confirmation."""

import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.control import laws, wire, wire_programs, wire_report
from benchmarks.control.alternative_process import ConstantLaw
from benchmarks.control.cases import LIMB_MM, Asked
from benchmarks.control.laws import LAW
from benchmarks.control.plants import PLANT, limb_of, model_of, wiring_of
from benchmarks.control.wire import CONSTANT, Part, Wired, WiredPart
from controller.law.force_position import ForceReading
from controller.law.inverse_model import columns
from controller.loop.steps import TrackForce
from controller.simulated.alternatives import alternative_law
from controller.simulated.alternatives.alternative_tuning import DRIFTS_RAD_S
from mock_devices.parameters import load_parameters

LIMB = Part("limb", "average", 1.0, CONSTANT, 1)
GAINS = {"limb 2 Hz, 0.5 N": 4.0, "limb 2 Hz, 1 N": 4.0, "limb 2 Hz, 2 N": 3.0, "limb 2 Hz, 5 N": 2.0,
         "limb 2 Hz, 10 N": 1.2}  # fmt: skip


def track_of(part: Part) -> TrackForce:
    """The last track step of the part's program, with the numbers of its law."""
    wiring = wiring_of(PLANT)
    program = wire.with_law(part, wire_programs.program(part.kind, model_of(part.subject), wiring), wiring)
    return [step for step in program.steps if isinstance(step, TrackForce)][-1]


def test_the_loop_runs_the_constant_that_the_simulation_runs() -> None:
    """The step that goes over the wire, cycle by cycle, against `alternative_law` with the tables it was tuned with."""
    step, simulated = track_of(LIMB), laws.constant("average", PLANT)
    memory = ConstantLaw.begin(columns(step.gains), step.settings.inverse, 0.5)
    other = alternative_law.begin(simulated.table, simulated.settings.inverse, 0.5)
    for cycle in range(400):
        reading = ForceReading(0.5 + 0.1 * math.sin(0.05 * cycle), cycle)
        asked_N = 0.5 if cycle < 100 else 1.0
        ours, memory = ConstantLaw.increment(memory, columns(step.gains), step.settings, asked_N, reading, 0.001)
        theirs, other = alternative_law.increment(other, simulated.table, simulated.settings, asked_N, reading, 0.001)
        assert ours == pytest.approx(theirs, abs=1e-12)
    assert math.isnan(memory.tangent_N_mm)


def test_a_constant_goes_over_the_wire_with_its_own_numbers_and_the_law_with_its_own() -> None:
    tuning = laws.tuning_of("constant", ("average",), PLANT, DRIFTS_RAD_S)
    constant, ours = track_of(LIMB), track_of(LIMB._replace(law=LAW))
    numbers = constant.crossover_rad_s, constant.lead_s, constant.drift_rad_s
    assert numbers == pytest.approx((tuning.integral, tuning.lead_s, tuning.drift_rad_s))
    assert ours.crossover_rad_s == laws.track_step("average", PLANT).crossover_rad_s
    assert track_of(LIMB._replace(law=wire.BEST_AT_CONTACT)).drift_rad_s == 0.0
    assert constant.gains == ours.gains


@pytest.mark.parametrize("kind", ["limb", "contact", "low jumps", "jumps"])
def test_the_simulation_plays_what_the_bench_is_asked_for(kind: wire_programs.Kind) -> None:
    wiring = wiring_of(PLANT)
    program = wire_programs.program(kind, model_of("average"), wiring)
    line, gap_mm = wire_programs.simulated_line(kind, program)
    tracks = [step for step in program.steps if isinstance(step, TrackForce)]
    assert line.duration_s == pytest.approx(sum(step.times_s[-1] for step in tracks[: 1 if gap_mm else None]))
    asked, force_N = wire.in_simulation(Part(kind, "average", 2.0, LAW, 1), program)
    found = wire_programs.judge(kind, 2.0, asked, force_N)
    expected = {"limb": 5, "contact": 1, "low jumps": 1, "jumps": 1}
    assert len(found) == expected[kind]
    assert all(math.isfinite(value) for value in found.values())


def test_an_error_of_a_limb_is_judged_at_the_end_of_each_level() -> None:
    time_s = 1e-3 * np.arange(12_500, dtype=np.float64)
    asked_N = np.array([0.5, 1.0, 2.0, 5.0, 10.0])[np.minimum((time_s / 2.5).astype(int), 4)]
    late = (time_s % 2.5) < 0.9  # far off while it settles, then a sine of 20 mN
    force_N = asked_N + np.where(late, 1.0, 0.02 * np.sqrt(2) * np.sin(2 * np.pi * 2.0 * time_s))
    found = wire_programs.judge("limb", 1.0, Asked(time_s, asked_N), force_N)
    assert list(found.values()) == pytest.approx([0.02] * 5, rel=0.02)


def test_a_peak_is_the_mean_of_all_touches() -> None:
    touch = np.full(600, 0.3)
    peaked = touch.copy()
    peaked[150:160] = 0.45
    asked = Asked(1e-3 * np.arange(1200, dtype=np.float64), np.full(1200, 0.3))
    found = wire_programs.judge("contact", 1.0, asked, np.concatenate([touch, peaked]))
    assert found == {"contact, 0 mm/s": pytest.approx((1.0 + 1.5) / 2)}


def parts(gain: float = 1.0, bench: float = 1.0) -> list[WiredPart]:
    """A law so many times as good as GAINS, with a bench on which all its errors are ``bench`` times as large."""
    found = []
    for subject in ("average", "firm"):
        for law, error in ((LAW, 0.01), (CONSTANT, 0.01)):
            numbers = [
                Wired(
                    case=case,
                    bench=error * (bench if law == LAW else gain * of),
                    simulated=error * (1.0 if law == LAW else gain * of),
                )
                for case, of in GAINS.items()
            ]
            found.append(WiredPart(part=Part("limb", subject, 1.0, law, 1), found=tuple(numbers), missed=0))
    return found


def test_gains_on_the_bench_stand_beside_those_simulated() -> None:
    confirmed = list(wire_report.gains(parts(bench=1.25)))
    assert [one.what for one in confirmed] == list(GAINS)
    assert [one.ratio for one in confirmed] == pytest.approx([0.8] * 5)
    assert [one.bench.value for one in confirmed] == pytest.approx([value / 1.25 for value in GAINS.values()])
    assert wire_report.missed(confirmed, 1.04) == []


def test_a_bench_that_gains_less_than_two_thirds_of_what_is_promised_confirms_nothing() -> None:
    """The planted bug: a law that is no better than the constant on the bench, whatever it is in simulation."""
    confirmed = list(wire_report.gains(parts(bench=4.0)))
    sentences = wire_report.missed(confirmed, 1.2)
    assert "limb 2 Hz, 0.5 N: 1.00x on the bench, less than two thirds of the 3x promised" in sentences
    assert any("the peak is 1.200 of what is asked for" in sentence for sentence in sentences)


def test_a_subject_on_whom_only_one_law_was_measured_does_not_count() -> None:
    assert next(iter(wire_report.gains(parts()[:-1]))).subjects == 1
    assert list(wire_report.gains(parts()[:1])) == []


def test_what_was_not_played_on_every_subject_confirms_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    sentences = wire_report.show(parts())
    assert "limb 2 Hz, 0.5 N: measured on 2 of 5 subjects" in sentences
    assert "jumps: measured on 0 of 5 subjects" in sentences
    assert "contact, 0 mm/s: measured on 0 of 5 subjects" in sentences
    assert "NOT CONFIRMED: low jumps: measured on 0 of 5 subjects" in capsys.readouterr().out
    whole = [
        WiredPart(part=part, found=tuple(Wired(case=case, bench=1.0, simulated=1.0) for case in cases), missed=0)
        for part in wire.parts(1)
        for cases in ([*GAINS] if part.kind == "limb" else [f"{part.kind}, x{part.stiffness:g}"],)
    ]
    assert wire_report.lacking(whole) == []


def test_a_measurement_goes_on_where_its_file_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, asked = tmp_path / "wire.jsonl", []
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))

    def measured(part: Part) -> WiredPart:
        asked.append(part)
        return parts()[0].model_copy(update={"part": part})

    monkeypatch.setattr(wire, "measured", measured)
    every = list(wire.parts(1))
    file.write_text(
        "".join(parts()[0].model_copy(update={"part": part}).model_dump_json() + "\n" for part in every[:3])
    )
    assert [one.part for one in wire.measure(file, 1.0, 1)] == every
    assert asked == every[3:]
    assert wire.measure(file, 0.0, 1) == wire.read(file)
    assert len(asked) == len(every) - 3
    assert wire.measure(tmp_path / "other.jsonl", -1.0, 1) == []


def test_the_tissue_on_the_bench_is_as_many_times_as_stiff(tmp_path: Path) -> None:
    wiring = wire.wiring_of(Part("jumps", "firm", 2.0, LAW, 1), tmp_path)
    assert wiring.mock.parameters
    tissue = load_parameters(wiring.mock.parameters).tissue
    stiff = limb_of(model_of("firm"), 2.0)
    depth_mm = float(stiff.depth_mm[300])
    force_N = tissue.a_N_mm * depth_mm * math.exp(tissue.b_per_mm * depth_mm)
    assert force_N == pytest.approx(float(stiff.force_N[300]), rel=1e-6)
    assert wiring.mock.hide == ()
    assert len(wire.wiring_of(LIMB, tmp_path).mock.hide) == 2


def test_no_part_needs_more_depth_than_the_bench_allows(tmp_path: Path) -> None:
    """A jump of 1 N may pass its level by a tenth of a newton; beyond the limit the bench would stop each time."""
    for part in wire.parts(1):
        allowed_mm = wire.wiring_of(part, tmp_path).limits.depth_mm
        limb = limb_of(model_of(part.subject), part.stiffness)
        line, _ = wire_programs.simulated_line(
            part.kind, wire_programs.program(part.kind, model_of(part.subject), wiring_of(PLANT))
        )
        deepest_mm = float(np.interp(max(line.forces_N) + 0.1, limb.force_N, limb.depth_mm))
        assert deepest_mm + 2 * LIMB_MM * (part.kind == "limb") < allowed_mm, part
