"""All products, by role; the first of each role is the one that a table without ``product`` means.

What is registered before `rig.config.wiring` is imported is a choice there like any other.
"""

from collections.abc import Mapping
from functools import reduce
from operator import or_
from typing import Annotated, Any, TypeVar

from pydantic import Discriminator, Tag, TypeAdapter

from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.products.ndi_polaris import PolarisWiring
from rig.config.products.roles import AxisProduct, ForceProduct, Product, TrackerProduct
from rig.config.products.usable import refusal_of
from rig.plugins import our_own
from rig.registry import Registry

AnyProduct = TypeVar("AnyProduct", bound=Product)


def name_of(product: type[Product]) -> str:
    """What ``product`` says in `rig.toml`."""
    return str(product.model_fields["product"].default)


def products_of(role: str, what: str, kind: type[AnyProduct], usual: type[AnyProduct]) -> Any:
    """The registry of ``role``: ``usual``, our other products, then plug-ins'; ``what`` is what messages call one."""
    group = f"tissue_rig.{role}"
    own = dict.fromkeys([usual, *our_own(group)])
    return Registry[type[AnyProduct]](what, name_of, own, group, refusal_of(kind))


FORCE_SENSORS: Registry[type[ForceProduct]] = products_of("force", "force sensor", ForceProduct, BotaWiring)
AXES: Registry[type[AxisProduct]] = products_of("axis", "servo axis", AxisProduct, Epos4Wiring)
TRACKERS: Registry[type[TrackerProduct]] = products_of("tracker", "marker tracker", TrackerProduct, PolarisWiring)
ROLES: Mapping[str, Registry[Any]] = {"force": FORCE_SENSORS, "axis": AXES, "tracker": TRACKERS}


def choice_of(products: Mapping[str, type[AnyProduct]]) -> Any:
    """The type of a table that is one of ``products``, told apart by its ``product``."""
    usual = next(iter(products))

    def chosen(value: object) -> object:
        return value.get("product", usual) if isinstance(value, Mapping) else getattr(value, "product", usual)

    if len(products) == 1:
        return products[usual]
    tagged = [Annotated[product, Tag(name)] for name, product in products.items()]
    return Annotated[reduce(or_, tagged), Discriminator(chosen)]


def read(products: Mapping[str, type[AnyProduct]], text: str) -> AnyProduct:
    """The product's table in the JSON ``text``, as a recording keeps it; raises ValidationError."""
    found: AnyProduct = TypeAdapter(choice_of(products)).validate_json(text)
    return found
