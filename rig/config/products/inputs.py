"""All inputs that the bench knows; the first is the one that a table without ``product`` means."""

from collections.abc import Mapping
from typing import Any

from rig.config.products.firmata_glove import FirmataGlove
from rig.config.products.input_role import InputProduct
from rig.config.products.registry import ROLES, products_of
from rig.registry import Registry

INPUTS: Registry[type[InputProduct]] = products_of("input", "input", InputProduct, FirmataGlove)
EVERY_ROLE: Mapping[str, Registry[Any]] = {**ROLES, "input": INPUTS}
