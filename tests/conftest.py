"""How every property is searched: without a time limit, and with the same examples each time.

How long an example takes says nothing on a machine that others use too, and a failure is worth most where it can be had
again; ``pytest --hypothesis-profile=default`` looks for new examples.
"""

from hypothesis import HealthCheck, settings

settings.register_profile(
    "shared machine", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("shared machine")
