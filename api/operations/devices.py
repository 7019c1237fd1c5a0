"""What this installation knows: products with their options, and plug-ins with what is wrong with them."""

import contextlib
import inspect
from collections.abc import Callable
from functools import cache
from pkgutil import resolve_name
from typing import get_type_hints

import rig
from drivers.kept import lack
from rig import plugins
from rig.config.products.inputs import EVERY_ROLE
from rig.config.products.roles import Product
from rig.config.words import toml, value_words
from rig.deadline import within
from rig.diagnosis.effects.axis import AXIS_CAUSES
from rig.diagnosis.effects.registry import CAUSES
from rig.registry import known
from rig.results.devices import DevicesResult, PluginListed, ProductListed, ProductOption
from rig.tissue.registry import LAWS

# Each has looked at its own group of entry points when it was loaded.
REGISTRIES = (*EVERY_ROLE.values(), LAWS, CAUSES, AXIS_CAUSES)


def devices(product: str = "") -> DevicesResult:
    """All products, or that one; raises UsageError with the nearest where there is none of that name."""
    listed = [_listed(role, name, one) for role, products in EVERY_ROLE.items() for name, one in products.items()]
    if product:
        known(product, [one.product for one in listed], "product")
    return DevicesResult(
        software=f"tissue-rig {rig.__version__}",
        products=tuple(one for one in listed if product in ("", one.product)),
        plugins=tuple(_plugin(one) for group in sorted(plugins.met()) for one in plugins.met()[group]),
    )


def _listed(role: str, name: str, product: type[Product]) -> ProductListed:
    plugin = plugins.declaring(f"tissue_rig.{role}", name)
    whose, version = (plugin.distribution, plugin.version) if plugin else ("tissue-rig", rig.__version__)
    return ProductListed(
        role=role,
        product=name,
        meaning=(inspect.getdoc(product) or "").partition("\n")[0],
        distribution=whose,
        distribution_version=version,
        rate_Hz=product().promised_Hz,
        simulated=product.mock is not None,
        options=options(product),
    )


def options(product: type[Product]) -> tuple[ProductOption, ...]:
    """The keys of its table."""
    schema = product.model_json_schema()
    return tuple(
        ProductOption(
            key=name,
            value=value_words(schema["properties"][name], schema.get("$defs", {})),
            default=toml(field.get_default(call_default_factory=True)),
            meaning=field.description or "",
        )
        for name, field in product.model_fields.items()
        if name != "product"
    )


def _plugin(plugin: plugins.Plugin) -> PluginListed:
    role = plugin.group.rpartition(".")[2]
    return PluginListed(
        group=plugin.group,
        name=plugin.name,
        distribution=plugin.distribution,
        distribution_version=plugin.version,
        declares=plugin.declares,
        error=plugin.error or (_unusable(role, EVERY_ROLE[role][plugin.declares]) if role in EVERY_ROLE else ""),
    )


def _promised(driver: Callable[..., object]) -> type | None:
    """The class it says it returns; None where that is a base of others, or cannot be told, which harms no driver."""
    with contextlib.suppress(Exception):
        made = get_type_hints(driver).get("return")
        if inspect.isclass(made) and not inspect.isabstract(made) and not getattr(made, "_is_protocol", False):
            return made
    return None


@cache
def _unusable(role: str, product: type[Product]) -> str:
    """What its driver and its mock's maker lack, as far as that shows before a device is opened; empty if nothing."""
    try:
        with within(plugins.IMPORT_S):
            driver = resolve_name(product.driver)
            maker = resolve_name(product.mock.maker) if product.mock else devices
            made = driver if inspect.isclass(driver) else _promised(driver)
    except (Exception, SystemExit) as error:  # whatever a plug-in does while it is imported is its own failure
        return f"{type(error).__name__}: {error}"
    no_calls = [name for name, one in ((product.driver, driver), ("its mock's maker", maker)) if not callable(one)]
    absent = lack(made, role) if made else ""
    return "; ".join(filter(None, [absent, *(f"{name} is no function" for name in no_calls)]))
