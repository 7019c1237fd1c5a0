"""What this service can do, from where each part states it itself: settled when it starts."""

import re
from collections import defaultdict
from importlib import metadata
from typing import get_args

from api.catalogue.settings import MOST
from api.http.access.limits import KNOWN
from api.http.access.rights import LARGEST_BODY_BYTES
from api.http.jobs.board import MOST_WAITING
from api.http.jobs.kinds import KINDS
from api.http.models import Capabilities, ServiceLimits
from api.http.routes.common import PREFIX
from api.http.routes.sessions import Format
from api.http.streams.connections import MESSAGES, MOST_OPEN, MOST_OPEN_EACH
from api.http.streams.history import KEPT_S
from api.http.streams.latest import MOST_LATEST
from api.http.streams.messages import HIGHEST_HZ, LARGEST_MESSAGE_BYTES, LOWEST_HZ, MOST_STREAMS, PROTOCOL
from api.http.streams.signals import signals
from api.http.uploads import LARGEST_UPLOAD_BYTES
from rig.config.products.inputs import EVERY_ROLE
from rig.config.wiring import Wiring

DISTRIBUTION = "tissue-rig"
# What the program is made with, of no use to who runs it.
OWN = {"dev", "docs"}
NEEDED = re.compile(r"(?P<name>[\w.-]+).*extra == ['\"](?P<extra>[\w-]+)['\"]")


def capabilities_of(wiring: Wiring) -> Capabilities:
    """Of a bench with this ``wiring``, whether or not it is connected."""
    return Capabilities(
        products={role: sorted(products) for role, products in EVERY_ROLE.items()},
        extras=installed(metadata.requires(DISTRIBUTION) or []),
        jobs=sorted(KINDS),
        export_formats=list(get_args(Format)),
        streams={name: signal.unit for name, signal in signals(wiring).items()},
        protocols=[PREFIX.rpartition("/")[2], PROTOCOL],
        transports={"http": PREFIX, "websocket": f"{PREFIX}/stream", "server-sent events": f"{PREFIX}/events"},
        limits=ServiceLimits(
            body_bytes=LARGEST_BODY_BYTES, upload_bytes=LARGEST_UPLOAD_BYTES, page_entries=MOST,
            waiting_jobs=MOST_WAITING, requests_per_s=KNOWN.per_s, channels=MOST_STREAMS, open_connections=MOST_OPEN,
            open_connections_each=MOST_OPEN_EACH, message_bytes=LARGEST_MESSAGE_BYTES, messages_per_s=MESSAGES.per_s,
            lowest_rate_hz=LOWEST_HZ, highest_rate_hz=HIGHEST_HZ, latest_samples=MOST_LATEST, kept_s=KEPT_S,
        ),
    )  # fmt: skip


def installed(requirements: list[str]) -> list[str]:
    """Extras of which every distribution is there."""
    needed: dict[str, list[str]] = defaultdict(list)
    for found in filter(None, map(NEEDED.match, requirements)):
        needed[found["extra"]].append(found["name"])
    return sorted(extra for extra, names in needed.items() if extra not in OWN and all(map(_is_there, names)))


def _is_there(name: str) -> bool:
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True
