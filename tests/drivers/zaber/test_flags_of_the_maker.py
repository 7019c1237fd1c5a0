"""The table of flags against the maker's own."""

from zaber_motion.ascii import warning_flags

from drivers.zaber.flags import FLAGS


def test_no_flag_of_the_maker_is_missing_and_none_is_invented() -> None:
    known = {flag for name, flag in vars(warning_flags.WarningFlags).items() if name.isupper()}
    assert known == set(FLAGS)
