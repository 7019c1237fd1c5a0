"""The conformance kit: what every driver must keep, called by a driver's own tests on its own mock.

``CHECKS`` are functions of a `UnderTest`; each raises `Nonconformity`, an AssertionError, with one sentence::

    @pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
    def test_it_conforms(check, subject):
        check(subject)
"""

from drivers.testing.checks import CHECKS
from drivers.testing.under_test import Nonconformity, UnderTest

__all__ = ["CHECKS", "Nonconformity", "UnderTest"]
