"""What the axis does for a limb that pushes while the tip rests: it retreats, or it loses its power.

``retreat``: the drive is enabled again where an immediate stop had stopped it, and the tip leaves, only away from the
limb. ``release``: the drive is powered off, for an axis that a limb can push back; one that a brake or its screw holds
would stand like a wall, so that the wiring refuses this for it.
"""

from drivers.roles import ServoAxis
from rig.config.wiring import Limits
from rig.errors import DeviceError


def give_way(axis: ServoAxis, limits: Limits) -> bool:
    """Brings the drive to where it can give way; whether it retreats. Raises DeviceError where it can do neither."""
    if limits.when_pushed == "release":
        axis.power_off()
        return False
    if axis.fault:
        raise DeviceError(f"the axis cannot give way, its drive is in fault ({axis.fault}): take the limb away")
    if not axis.enabled:
        axis.enable()
    return True
