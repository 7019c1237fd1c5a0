"""The table of flags against the maker's own."""

import pytest

from drivers.zaber.flags import FLAGS

warning_flags = pytest.importorskip("zaber_motion.ascii.warning_flags")


def test_no_flag_of_the_maker_is_missing_and_none_is_invented() -> None:
    known = {flag for name, flag in vars(warning_flags.WarningFlags).items() if name.isupper()}
    assert known == set(FLAGS)
