"""The picture of a comparison: what stands beside each other is drawn at one scale that begins at nothing."""

from rig.report.compared_figure import comparison_figure
from rig.results.tracking import AlternativeRun, ComparedRun, WorstJump


def worst(overshoot_percent: float, settling_s: float | None) -> WorstJump:
    return WorstJump(
        error_N=0.0, error_percent=0.0, largest_error_N=0.0, overshoot_percent=overshoot_percent, settling_s=settling_s
    )


def test_a_small_difference_is_not_drawn_as_a_large_one_and_what_never_settled_is_said_to_lack() -> None:
    bench = ComparedRun(subject="firm", stopped="", worst=worst(1.0, 0.04), jumps=(), levels=())
    simulated = [
        AlternativeRun(subject="firm", law=law, worst=worst(1.0, 0.04), worst_of_wrong=worst(14.0, settling_s))
        for law, settling_s in (("force law", 0.18), ("constant", 0.20), ("variable admittance", None))
    ]
    figure = comparison_figure([bench], simulated)
    assert [axes.get_ylim()[0] for axes in figure.axes] == [0.0] * 4
    assert {axes.get_xlim() for axes in figure.axes} == {(-0.5, 0.5)}
    assert [axes.get_xlabel() for axes in figure.axes] == ["", "no mark: a jump did not settle"] * 2
