"""In what our page is worse than OctoPrint's, as the benchmark judges it."""

from dataclasses import replace

from benchmarks.octoprint import Found, worse

OTHER = Found(3.3, None, 2.0, 43, 960, 0)
OURS = Found(2.0, 1.1, 1.0, 0, 390, 0)


def test_a_page_that_is_as_good_or_better_in_all_is_not_worse() -> None:
    assert worse(OURS, OTHER) == worse(OTHER, OTHER) == worse(OURS, replace(OURS, width_at_390_px=375)) == []
    assert worse(replace(OURS, end_told_s=0.19), replace(OURS, end_told_s=0.05)) == []


def test_each_that_is_worse_is_named_and_silence_that_is_never_told_is_the_worst() -> None:
    assert worse(OTHER, OURS) == ["first_value_s", "hang_told_s", "end_told_s", "violations", "width_at_390_px"]
    assert worse(replace(OURS, hang_told_s=None, from_elsewhere=1), OURS) == ["hang_told_s", "from_elsewhere"]
