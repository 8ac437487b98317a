"""Guard against DNS rebinding: requests are served only for the names by which this server is known.

A page of another site can point its own name at this machine, and its scripts then have our Origin. Their Host is that
name, though: a browser sends what stands in the address, so that an address in digits cannot be used for this.
"""

import re
from collections.abc import Iterable
from ipaddress import IPv4Address, IPv6Address, ip_address

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from app.http.guards import refuse

HOST = re.compile(r"(?P<name>\[[0-9a-f:.]+\]|[a-z0-9._-]+)(?::[0-9]{1,5})?", re.IGNORECASE | re.ASCII)
LOOPBACK_NAME = "localhost"
ANY = "*"
UNKNOWN_HOST = "this server is not known by that Host; add it to WALK_HOSTS"


class KnownHosts:
    """Names and addresses under which the server may be requested, on any port."""

    def __init__(self, bound_to: str, names: Iterable[str] = ()) -> None:
        """Allow the loopback, the address that is listened on, and some names.

        Args:
            bound_to: address that is listened on; a wildcard allows every address in digits.
            names: further names or addresses, in any case; `*` allows all.
        """
        self._names = {LOOPBACK_NAME, *(_bare(name) for name in (bound_to, *names))}
        address = _address(_bare(bound_to))
        self._has_any_address = address is not None and address.is_unspecified

    def includes(self, host: str) -> bool:
        """Whether a Host header, with or without a port, names this server."""
        match = HOST.fullmatch(host)
        if match is None:
            return False
        name = _bare(match["name"])
        if ANY in self._names or name in self._names:
            return True
        address = _address(name)
        return address is not None and (address.is_loopback or self._has_any_address)


class KnownHostMiddleware:
    """Refuses requests and websockets for hosts that are not known, with 421, and those without exactly one Host."""

    def __init__(self, app: ASGIApp, hosts: KnownHosts) -> None:
        """Guard `app`."""
        self._app, self._hosts = app, hosts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or refuse."""
        if scope["type"] not in ("http", "websocket") or self._is_known(Headers(scope=scope)):
            await self._app(scope, receive, send)
        else:
            await refuse(421, UNKNOWN_HOST, scope, receive, send)

    def _is_known(self, headers: Headers) -> bool:
        hosts = headers.getlist("host")
        return len(hosts) == 1 and self._hosts.includes(hosts[0])


def _bare(name: str) -> str:
    """A name in lower case, without the dot of the root; an address as Python writes it, without brackets."""
    name = name.strip().lower().removesuffix(".").removeprefix("[").removesuffix("]")
    address = _address(name)
    return name if address is None else str(address)


def _address(name: str) -> IPv4Address | IPv6Address | None:
    try:
        return ip_address(name)
    except ValueError:
        return None
