"""Where the service listens, and by what names those who use it come there.

On this computer alone, unless what is said on the way is encrypted: by a certificate of its own, or by a reverse proxy
on this computer that is declared.
"""

import ipaddress
import re
import socket
import ssl
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import urlsplit

from controller.stop.http import LOCAL
from rig.errors import UsageError

EVERYWHERE = ("0.0.0.0", "::")
# Labels of a host's name, RFC 1123.
NAME = re.compile(r"(?=.{1,253}$)[a-z0-9]([a-z0-9-]{0,61}[a-z0-9])?(\.[a-z0-9]([a-z0-9-]{0,61}[a-z0-9])?)*")
HTTPS = 443
LAST_PORT = 65535
OTHERS_READ = 0o004


@dataclass(frozen=True)
class ServedAt:
    """``names`` are those that it is reached by beside its numbers; ``proxy`` is the address of the one before it."""

    host: str
    port: int
    names: tuple[str, ...] = ()
    tls: ssl.SSLContext | None = None
    proxy: str = ""
    files: tuple[Path, Path] | None = None
    """Certificate and key, for who takes stops beside the service."""
    stop_port: int = 0

    @property
    def here(self) -> str:
        """Its address for programs on this computer."""
        return self._address(LOCAL[0] if self.host in EVERYWHERE else self.host)

    @property
    def address(self) -> str:
        """What people open."""
        return self.proxy or (self._address(self.names[0]) if self.names else self.here)

    @property
    def alone(self) -> bool:
        """Whether it is for this computer alone."""
        return not (self.tls or self.proxy)

    def _address(self, host: str) -> str:
        return f"{'https' if self.tls else 'http'}://{bracketed(host)}:{self.port}"


def bracketed(host: str) -> str:
    """As it is written in an address."""
    return f"[{host}]" if ":" in host else host


@dataclass(frozen=True)
class ServeOptions:
    """What the command line asks for."""

    host: str
    port: int
    names: tuple[str, ...]
    certificate: Path | None
    key: Path | None
    proxy: str
    stop_port: int | None = None

    @property
    def port_of_stops(self) -> int:
        """The one asked for, else near the service's own."""
        return min(self.port + 2, LAST_PORT) if self.stop_port is None else self.stop_port


def served_at(asked: ServeOptions) -> ServedAt:
    """The place that was asked for; raises UsageError where it would let others read along, or a file is not right."""
    files = (asked.certificate, asked.key) if asked.certificate and asked.key else None
    return replace(_place(asked), files=files, stop_port=asked.port_of_stops)


def _place(asked: ServeOptions) -> ServedAt:
    names = tuple(_name(name) for name in asked.names)
    if asked.proxy:
        return _behind(asked, names)
    tls = _tls(asked.certificate, asked.key)
    if asked.host in LOCAL:
        return ServedAt(asked.host, asked.port, names, tls)
    if tls is None:
        raise UsageError(
            f"--host {asked.host}: others on the network would read tokens and passwords on the way; give --tls-cert"
            f" and --tls-key, or stay on {LOCAL[0]} behind a reverse proxy (--behind-proxy https://NAME)"
        )
    return ServedAt(asked.host, asked.port, names or _own_names(asked.host), tls)


def _behind(asked: ServeOptions, names: tuple[str, ...]) -> ServedAt:
    if asked.certificate or asked.key or asked.host not in LOCAL:
        raise UsageError(
            f"--behind-proxy {asked.proxy}: the proxy has the certificate and this service listens on {LOCAL[0]} alone;"
            " leave out --host, --tls-cert and --tls-key"
        )
    try:
        parts = urlsplit(asked.proxy)
        name, port = _name(parts.hostname or ""), parts.port
    except (ValueError, UsageError):
        name, port = "", None
    plain = f"https://{name}" + (f":{port}" if port not in (None, HTTPS) else "")
    if not name or asked.proxy.rstrip("/").lower() not in (plain, f"{plain}:{HTTPS}"):
        raise UsageError(f"--behind-proxy {asked.proxy}: write what people open, as https://bench.example.org")
    return ServedAt(asked.host, asked.port, (name, *names), proxy=plain)


def _name(name: str) -> str:
    if not NAME.fullmatch(name.lower()):
        raise UsageError(f"--name {name}: is no host name; write it as in bench.example.org, without https:// and port")
    return name.lower()


def _own_names(host: str) -> tuple[str, ...]:
    """Where none are given: this computer's name if it listens on every address, or the name that it listens on."""
    if host in EVERYWHERE:
        own = socket.gethostname().lower()
        return (own,) if NAME.fullmatch(own) else ()
    return () if _is_number(host) else (_name(host),)


def _is_number(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def _tls(certificate: Path | None, key: Path | None) -> ssl.SSLContext | None:
    if certificate is None and key is None:
        return None
    if certificate is None or key is None:
        given, missing = ("--tls-cert", "--tls-key") if certificate else ("--tls-key", "--tls-cert")
        raise UsageError(f"{given}: needs {missing} too: a certificate and its private key, both in PEM")
    for option, file in (("--tls-cert", certificate), ("--tls-key", key)):
        _refuse_unreadable(option, file)
    if key.stat().st_mode & OTHERS_READ:
        raise UsageError(f"--tls-key {key}: everybody on this computer may read it; `chmod o= {key}`")
    return tls_context(certificate, key)


def _refuse_unreadable(option: str, file: Path) -> None:
    try:
        file.read_bytes()
    except OSError as error:
        raise UsageError(f"{option} {file}: cannot be read: {error.strerror}; correct path or rights") from error


def tls_context(certificate: Path, key: Path) -> ssl.SSLContext:
    """TLS 1.2 and newer, without tickets: as one comes, clients of two threads (Python before 3.13) lose a request."""

    def locked() -> str:
        raise UsageError(f"--tls-key {key}: is locked by a password, which nobody types at a service; give it without")

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.set_alpn_protocols(["http/1.1"])
    context.num_tickets = 0
    try:
        context.load_cert_chain(certificate, key, locked)
    except ssl.SSLError as error:
        why = "that is the key of another certificate" if error.reason == "KEY_VALUES_MISMATCH" else "not both are PEM"
        raise UsageError(f"--tls-cert {certificate}, --tls-key {key}: {why}; give a certificate and its key") from error
    return context
