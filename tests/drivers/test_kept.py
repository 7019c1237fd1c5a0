"""One table says what the driver of each role keeps."""

import pytest

from drivers.kept import KEPT, lack
from drivers.roles import Device
from rig.config.products.inputs import EVERY_ROLE


def test_every_role_is_kept_and_its_products_are_what_it_says() -> None:
    assert KEPT.keys() == EVERY_ROLE.keys()
    for role, products in EVERY_ROLE.items():
        assert all(issubclass(product, KEPT[role].declared) for product in products.values())
        assert Device in KEPT[role].protocol.__mro__


@pytest.mark.parametrize(
    ("role", "said"),
    [("force", "no poll, which ForceSensor has"), ("tracker", "no poll, which MarkerTracker has"),
     ("input", "no concern, no poll, which Input has")],
)  # fmt: skip
def test_what_a_driver_lacks_is_said_in_the_words_of_its_role(role: str, said: str) -> None:
    methods = dict.fromkeys(("start", "fileno", "close"), lambda _: None)
    assert lack(type("Half", (), methods), role) == f"its driver has {said}"
    assert lack(type("Whole", (), methods | dict.fromkeys(("poll", "concern"), print)), role) == ""
