"""Which products this installation knows, what plug-ins failed, and what was found at the computer's ports."""

from pydantic import Field

from rig.results.base import Result, SavedResult


class ProductOption(Result):
    """One key of a product's table."""

    key: str
    value: str = Field(description="what it may be, in words")
    default: str
    meaning: str


class ProductListed(Result):
    """A product that `rig.toml` can name."""

    role: str
    product: str
    meaning: str
    distribution: str = Field(description="whose it is")
    distribution_version: str
    rate_Hz: float | None = Field(description="samples a second as its table stands without a line; null: as asked")
    simulated: bool = Field(description="whether the mock bench can play it")
    options: tuple[ProductOption, ...]


class PluginListed(Result):
    """An entry point of another distribution; ``error`` is why it is not used, empty where it is."""

    group: str
    name: str
    distribution: str
    distribution_version: str
    declares: str
    error: str


class DevicesResult(SavedResult):
    """All products and plug-ins."""

    software: str
    products: tuple[ProductListed, ...]
    plugins: tuple[PluginListed, ...]


class PortFound(Result):
    """One port of the computer: what USB says of it, and who answered there where somebody was allowed to ask."""

    address: str
    usb: str = Field(description="vendor and product number, maker and name as USB gives them; empty without USB")
    kind: str = Field(description="what such an adapter usually is")
    asked: bool = Field(description="whether bytes were sent to it")
    role: str = ""
    product: str = ""
    device: str = Field(default="", description="who answered")
    serial: str = ""
    problem: str = Field(default="", description="why nobody could be asked, or that nobody answered")
    lines: str = Field(default="", description="for `rig.toml`")


class FindResult(SavedResult):
    """Every port that was looked at."""

    ports: tuple[PortFound, ...]
