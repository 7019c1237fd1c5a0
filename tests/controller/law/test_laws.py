"""Which tissue laws a force loop can be designed for: all that are stiff from contact on."""

from dataclasses import replace

import numpy as np
import pytest

from api.cli.options import built_in
from controller.experiments.tracking import force_law
from mock_devices.testing.models import index_model
from rig.errors import UsageError
from rig.tissue.laws import Law
from rig.tissue.model import ValidRange
from tests.rig.tissue.examples import EXAMPLES

SOFT_AT_CONTACT = {"power", "hunt_crossley"}
UNDAMPED = {law.name for law in EXAMPLES if not float(law.damping(np.array(1.0))) > 0} - SOFT_AT_CONTACT
MODEL = index_model(0.12, 0.22, 0.01)


@pytest.mark.parametrize("law", EXAMPLES, ids=[law.name for law in EXAMPLES])
def test_the_law_follows_the_tangent_of_any_tissue_that_is_stiff_at_contact_and_damped(law: Law) -> None:
    valid = ValidRange(depth_mm=float(law.depth(10.0)), force_N=10.0, speeds_mm_s=(5.0,))
    size = len(law.values)
    known = {p.name: (p.value, p.value) for p in law.parameters}
    model = replace(MODEL, law=law, valid=valid, covariance=np.zeros((size, size)), intervals=known)
    if law.name in SOFT_AT_CONTACT:
        with pytest.raises(UsageError, match=r"tangent stiffness at 0 mm is 0 N/mm; .*--model index"):
            force_law(model, built_in())
        return
    if law.name in UNDAMPED:
        with pytest.raises(UsageError, match=r"the model's damping is 0 N s/mm, 0 to 0; .*several speeds"):
            force_law(model, built_in())
        return
    gains = force_law(model, built_in()).gains
    for row in gains:
        assert row.tangent_N_mm == pytest.approx(float(law.tangent_stiffness(row.depth_mm)))
        assert row.damping_N_s_mm >= 0.0015 * row.tangent_N_mm
    assert gains[-1].force_N == pytest.approx(10.0)
