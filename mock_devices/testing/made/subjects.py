"""The five subjects as models that know their tissue, and how the simulated axis answers."""

from functools import cache
from pathlib import Path

import mock_devices
from mock_devices.parameters import load_parameters
from mock_devices.testing.models import index_model
from rig.config.axis_response import AxisResponse
from rig.tissue.model import Model

NAMES = ("soft", "average", "lean", "firm", "tense")
FOLDER = Path(mock_devices.__file__).parent / "subjects"
# Least squares of the simulated axis' response from set-point to force, 1 to 60 Hz, one cycle of the sensor included
# (test_response.py fits it again).
RESPONSE = AxisResponse(0.00197, 0.00246, 0.00372, 0.0067)
# The same with the FT 300 of test_slow_sensor.py: a filter of 3 ms and four cycles of delay.
SLOW_RESPONSE = AxisResponse(0.00605, 0.00384, 0.00384, 0.0067)


@cache
def subject(name: str) -> Model:
    """Known up to 11 N."""
    tissue = load_parameters(FOLDER / f"{name}.toml").tissue
    return index_model(tissue.a_N_mm, tissue.b_per_mm, tissue.damping_N_s_mm, force_N=11.0)
