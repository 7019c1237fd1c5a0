"""Data in an object store, named by its address: fetched into a folder for as long as somebody works on it.

Everything that reads takes a folder, so a copy is what it gets: whole, or one sentence that says why not. An object
that was replaced between the listing and the copy would make a session of two states; its tag tells.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.errors import DataError, UsageError
from rig.progress import Progress, silent

# `Path` folds the slashes of an address into one; two letters at least: one is a drive of another system.
_ADDRESS = re.compile(r"([a-z][a-z0-9+]+):/{1,2}([^/].*)")
_TAGS = ("ETag", "etag", "md5Hash", "mtime", "created", "LastModified")
# What libraries of stores raise, by name: none of them is loaded where nobody names a store.
_SAYS: Mapping[str, str] = {
    "NoCredentialsError": "no credentials; set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or a profile",
    "PartialCredentialsError": "credentials are not complete; set both AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY",
    "EndpointConnectionError": "the store does not answer; check its address (AWS_ENDPOINT_URL) and the network",
    "ConnectTimeoutError": "the store does not answer; check its address (AWS_ENDPOINT_URL) and the network",
    "PermissionError": "these credentials may not read it; ask who owns the bucket",
    "FileNotFoundError": "no such bucket, or nothing in it by that name; check the address",
}


@dataclass(frozen=True)
class StoredObject:
    """One object as the listing has it: its key in the store, its name below the place, its tag, its size."""

    key: str
    name: str
    tag: str
    bytes: int


def address_of(place: Path) -> str | None:
    """The address that ``place`` was written as; None of a path."""
    found = _ADDRESS.fullmatch(str(place))
    return f"{found[1]}://{found[2]}" if found else None


class Store:
    """The objects at and below one address; raises DataError or UsageError in one sentence."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._files, self._root = self._opened(address)

    @staticmethod
    def _opened(address: str) -> tuple[Any, str]:
        import fsspec  # noqa: PLC0415 - a fifth of a second that only stores need

        protocol = address.partition("://")[0]
        try:
            files, root = fsspec.core.url_to_fs(address, use_listings_cache=False, skip_instance_cache=True)
        except ImportError as error:
            extra = "pip install 'tissue-rig[s3]'" if protocol == "s3" else str(error)
            raise UsageError(
                f"{address}: reading {protocol}:// needs a library that is not installed: {extra}"
            ) from None
        except ValueError:
            raise UsageError(f"{address}: no store is called {protocol}://; s3:// is read") from None
        return files, str(root).rstrip("/")

    def objects(self) -> Sequence[StoredObject]:
        """What is there, by name."""
        found = self._asked(lambda: self._files.find(self._root, detail=True))
        listed = [self._object(key, about) for key, about in sorted(found.items())]
        if not listed:
            raise DataError(f"{self.address}: {_SAYS['FileNotFoundError']}")
        return listed

    def fetch(self, folder: Path, tell: Progress = silent) -> Path:
        """A copy in ``folder``: the folder of what lies below the address, or the one file that it names."""
        listed = self.objects()
        target = folder / self._root.rpartition("/")[2]
        for number, each in enumerate(listed):
            tell(f"fetching {each.name or each.key}", number / len(listed))
            self._copy(each, target / each.name if each.name else target)
        return target

    def _copy(self, wanted: StoredObject, target: Path) -> None:
        target.parent.mkdir(parents=True, exist_ok=True)
        self._asked(lambda: self._files.get_file(wanted.key, str(target)))
        after = self._object(wanted.key, self._asked(lambda: self._files.info(wanted.key, refresh=True)))
        if after != wanted or target.stat().st_size != wanted.bytes:
            raise DataError(
                f"{self.address}: {wanted.name or wanted.key} was changed while it was read; wait until whoever writes "
                "it has finished, and begin again"
            )

    def _object(self, key: str, about: Mapping[str, Any]) -> StoredObject:
        name = key.removeprefix(self._root).lstrip("/")
        if ".." in Path(name).parts:
            raise DataError(f"{self.address}: {key} leads out of the folder it would be copied to; rename it")
        tag = next((str(about[tag]) for tag in _TAGS if about.get(tag)), "")
        return StoredObject(key, name, tag, int(about.get("size") or 0))

    def _asked(self, ask: Any) -> Any:
        try:
            return ask()
        except Exception as error:
            said = next((_SAYS[kind.__name__] for kind in type(error).__mro__ if kind.__name__ in _SAYS), None)
            if said is None and not isinstance(error, OSError) and not _is_client(error):
                raise
            raise DataError(f"{self.address}: {said or f'the store answered: {error}'}") from error


def _is_client(error: Exception) -> bool:
    """Whether a store's own library raised it."""
    return type(error).__module__.startswith(("botocore", "aiobotocore", "aiohttp", "fsspec", "s3fs"))
