"""Delays after wrong tokens, which grow with their number, so that guessing takes too long."""

import hashlib
import math
from collections import OrderedDict
from dataclasses import dataclass, field
from ipaddress import IPv6Address, ip_address

FREE = 10  # different wrong tokens that an address may show without a delay
LONGEST = 300.0  # [s]
FORGOTTEN_AFTER = 3600.0  # [s] without a wrong token
MAX_ADDRESSES = 1024
MAX_TOKENS = FREE + 9  # of an address that are told apart: the last of them has the longest delay
RATE, BURST = 5.0, 300  # wrong tokens of all addresses together, a second and at once: addresses can be many
DIGEST = 8  # bytes by which a wrong token is known again
PREFIX = 64  # bits of an IPv6 address; a host has all that begin with them


@dataclass(slots=True)
class _Record:
    """The different wrong tokens of an address."""

    tokens: set[bytes] = field(default_factory=set)
    last: float = -math.inf
    until: float = -math.inf


class WrongTokens:
    """Wrong tokens by the addresses that showed them. Belongs to the event loop; its memory is bounded.

    The same wrong token again is no guess: a program whose token has changed holds nobody up.
    """

    def __init__(self) -> None:
        """Start without any."""
        self._records = OrderedDict[str, _Record]()
        self._level, self._at = 0.0, 0.0

    def wait(self, address: str, now: float) -> float:
        """Time until a token of this address is looked at again [s]; zero at once.

        Args:
            address: of the client.
            now: time of a clock that only goes forward [s].
        """
        record = self._records.get(_group(address))
        own = 0.0 if record is None else record.until - now
        common = (self._decayed(now) - BURST) / RATE
        return max(0.0, own, common)

    def count(self, address: str, token: bytes, now: float) -> None:
        """Note that an address has shown a wrong token; see `wait`."""
        group = _group(address)
        record = self._records.pop(group, None)
        if record is None or now - record.last > FORGOTTEN_AFTER:
            record = _Record()
        self._records[group] = record  # as the latest
        if len(self._records) > MAX_ADDRESSES:
            self._records.popitem(last=False)
        record.last = now
        digest = hashlib.blake2b(token, digest_size=DIGEST).digest()
        if digest in record.tokens:
            return
        if len(record.tokens) < MAX_TOKENS:
            record.tokens.add(digest)
        self._level, self._at = self._decayed(now) + 1.0, now
        nb_delayed = len(record.tokens) - FREE
        if nb_delayed > 0:
            record.until = now + min(2.0**nb_delayed, LONGEST)

    def _decayed(self, now: float) -> float:
        return max(0.0, self._level - RATE * (now - self._at))


def _group(address: str) -> str:
    """Addresses that one host may have at will, as one."""
    try:
        parsed = ip_address(address)
    except ValueError:
        return address
    if isinstance(parsed, IPv6Address) and parsed.ipv4_mapped is None:
        return str(IPv6Address(int(parsed) >> (128 - PREFIX) << (128 - PREFIX)))
    return str(parsed)
