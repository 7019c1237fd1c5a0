"""Our own products are declared by entry points, in the groups that plug-ins have; our laws keep what theirs must."""

import importlib
import pkgutil
import tomllib
from importlib.metadata import entry_points
from pathlib import Path

import pytest

import rig.config.products
from rig import plugins
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.inputs import EVERY_ROLE
from rig.config.products.registry import name_of, products_of
from rig.config.products.roles import ForceProduct, Product
from rig.errors import UsageError
from rig.tissue.registry import LAWS, refusal

ROOT = Path(__file__).parents[2]


def written() -> set[tuple[str, type[Product]]]:
    """Every class below `rig.config.products` that is a product with a name of its own."""
    modules = [
        importlib.import_module(f"rig.config.products.{one.name}")
        for one in pkgutil.iter_modules(rig.config.products.__path__)
    ]
    found = [item for module in modules for item in vars(module).values() if isinstance(item, type)]
    own = [one for one in found if issubclass(one, Product) and "product" in one.model_fields]
    return {(name_of(one), one) for one in own if name_of(one) and not name_of(one).startswith("Pydantic")}


def test_every_product_that_is_written_is_declared_by_its_name_and_nothing_else_is() -> None:
    declared = {
        (point.name, point.load())
        for role in EVERY_ROLE
        for point in entry_points(group=f"tissue_rig.{role}")
        if point.dist is not None and point.dist.name == plugins.OURS
    }
    assert declared == written()


def test_what_is_installed_is_what_the_project_declares() -> None:
    points = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    for role, products in EVERY_ROLE.items():
        assert points[f"tissue_rig.{role}"].keys() <= products.keys()


def test_our_own_are_no_plug_ins() -> None:
    assert plugins.OURS not in {one.distribution for found in plugins.met().values() for one in found}
    assert plugins.declaring("tissue_rig.force", "bota-sensone") is None


@pytest.mark.parametrize("name", LAWS)
def test_our_own_laws_keep_what_is_asked_of_those_of_plug_ins(name: str) -> None:
    assert refusal(LAWS[name]) == ""


def test_a_folder_that_is_not_installed_says_so_where_a_product_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match=r"all: bota-sensone, .*[^d]$") as told:
        EVERY_ROLE["force"].named("acme")
    assert "not installed" not in str(told.value)
    monkeypatch.setattr(plugins, "OURS", "another")
    monkeypatch.setattr(plugins, "_met", {})
    alone = products_of("force", "force sensor", ForceProduct, BotaWiring)
    assert next(iter(alone)) == "bota-sensone"
    with pytest.raises(UsageError, match=r"; another is not installed, and declares nothing$"):
        alone.named("acme")
