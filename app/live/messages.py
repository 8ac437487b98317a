"""Requests and responses between the server and its control process, each a message of bounded length.

They go through a socket that keeps messages apart (SOCK_SEQPACKET) and neither end waits for: a whole message is sent
at once, or none of it. A request is one message. A response may be longer: it goes in parts, and a list goes item by
item, so that the control loop can send each between two ticks.
"""

import pickle
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

MAX_MESSAGE = 128 * 1024  # bytes: a socket of Linux takes 200 kB by default
MAX_REASON = 500  # characters of an error's text
HEADER = struct.Struct("<QB")  # number of the request, kind of the part


class NoResponseError(Exception):
    """The control process is gone, or has no time for more requests."""


class RequestFailedError(NoResponseError):
    """An unexpected error ended a request; the robot goes on."""


class MessageTooLongError(ValueError):
    """A message is longer than the receiver reads."""


class PartKind(IntEnum):
    """Kind of a part of a response."""

    MORE = 0
    """Part of a value, of which more follows."""
    ITEM = 1
    """Last part of an item of a list."""
    VALUE = 2
    """Last part of the response; where items came before, of None."""


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """One call of a method of the control."""

    number: int
    expires_at: float
    """Time after which it is not begun [s], on `time.perf_counter`, which all processes of the machine share."""
    method: Callable[..., Any]
    arguments: tuple[Any, ...]


def reason(error: Exception) -> str:
    """An error in one line of bounded length."""
    return f"{type(error).__name__}: {error}"[:MAX_REASON]


def packed(message: Any) -> bytes:
    """A message as it is sent.

    Raises:
        MessageTooLongError: if it is longer than `MAX_MESSAGE`: cut, it could not be read.
    """
    data = pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
    if len(data) > MAX_MESSAGE:
        raise MessageTooLongError(f"a message of {len(data)} bytes is longer than {MAX_MESSAGE}")
    return data


def response_parts(number: int, response: Any) -> Iterator[bytes]:
    """The messages of a response; one that cannot be sent is replaced by a `RequestFailedError`.

    Args:
        number: of its request.
        response: a value or an exception; of an iterator each item is received, then None.
    """
    try:
        if isinstance(response, Iterator):
            for item in response:
                yield from _value_parts(number, item, PartKind.ITEM)
            response = None
        yield from _value_parts(number, response, PartKind.VALUE)
    except Exception as error:
        yield from _value_parts(number, RequestFailedError(reason(error)), PartKind.VALUE)


def _value_parts(number: int, value: Any, kind: PartKind) -> Iterator[bytes]:
    data = pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
    size = MAX_MESSAGE - HEADER.size
    for start in range(0, len(data), size):
        is_last = start + size >= len(data)
        yield HEADER.pack(number, kind if is_last else PartKind.MORE) + data[start : start + size]


class ResponseParts:
    """Parts of responses that are not complete yet. Belongs to one thread."""

    def __init__(self) -> None:
        """Begin without any."""
        self._begun: dict[int, bytes] = {}

    def add(self, message: bytes) -> tuple[int, PartKind, Any] | None:
        """Number of the request, and the item or value that a message completes; None if it completes none."""
        number, kind = HEADER.unpack_from(message)
        data = self._begun.pop(number, b"") + message[HEADER.size :]
        if kind != PartKind.MORE:
            return number, PartKind(kind), pickle.loads(data)
        self._begun[number] = data
        return None


def has_sent(to: socket.socket, data: bytes) -> bool:
    """Send a message without waiting; False if the socket has no room for it, or nobody reads it any more."""
    with suppress(BlockingIOError, ConnectionError):
        to.send(data, socket.MSG_DONTWAIT)
        return True
    return False
