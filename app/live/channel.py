"""Memory that the server and its control process share: for each direction the latest value, and nothing older.

Nobody waits: a value goes to the oldest of a few buffers, then the count in front of them moves on. A reader that
was overtaken finds a checksum that does not fit, and reads again.
"""

import mmap
import os
import struct
import tempfile
import time
import zlib
from dataclasses import dataclass
from typing import Any

STATE_CAPACITY, INPUT_CAPACITY = 256 * 1024, 1024  # bytes
MAX_MESSAGE = 160 * 1024  # bytes of a request, of a response or of a chunk of one, which go through a socket
COUNT = struct.Struct("<Q")
HEADER = struct.Struct("<QdII")  # count, time, length, checksum
NB_BUFFERS = 4
RETRY_PERIOD = 1e-4  # [s] until a reader that was overtaken reads again


@dataclass(frozen=True, slots=True, eq=False)
class Chunk:
    """One element of a response that is sent element by element and received as a list, so that none delays a tick."""

    value: Any = None
    is_last: bool = False
    """Whether the response is complete; the last chunk carries no value."""


@dataclass(frozen=True, slots=True)
class Message:
    """The bytes that were in a `LatestValue` when it was read."""

    count: int
    """Number of values written so far, this one included; 0 before the first."""
    written_at: float
    """Time at which it was written, on `time.perf_counter`, which all processes of the machine share [s]."""
    data: bytes


class LatestValue:
    """Shared memory in which the latest value wins. One thread at a time writes; any process may read."""

    @staticmethod
    def size(capacity: int) -> int:
        """Bytes of memory that values of up to `capacity` bytes need."""
        return COUNT.size + NB_BUFFERS * (HEADER.size + capacity)

    def __init__(self, memory: memoryview, capacity: int) -> None:
        """Use the beginning of a memory.

        Args:
            memory: zeros before the first value is written.
            capacity: bytes of the longest value.
        """
        self._memory, self._capacity = memory, capacity

    @property
    def count(self) -> int:
        """Number of values written so far."""
        return COUNT.unpack_from(self._memory)[0]

    def write(self, data: bytes) -> None:
        """Replace the value.

        Raises:
            ValueError: if it is longer than the capacity.
        """
        if len(data) > self._capacity:
            raise ValueError(f"{len(data)} bytes where {self._capacity} fit")
        count = self.count + 1
        start = self._buffer(count)
        HEADER.pack_into(self._memory, start, count, time.perf_counter(), len(data), zlib.crc32(data))
        self._memory[start + HEADER.size : start + HEADER.size + len(data)] = data
        COUNT.pack_into(self._memory, 0, count)

    def read(self) -> Message:
        """The latest value."""
        while (count := self.count) > 0:
            start = self._buffer(count)
            found, written_at, length, checksum = HEADER.unpack_from(self._memory, start)
            data = bytes(self._memory[start + HEADER.size : start + HEADER.size + min(length, self._capacity)])
            if found == count and zlib.crc32(data) == checksum:
                return Message(count, written_at, data)
            time.sleep(RETRY_PERIOD)
        return Message(0, 0.0, b"")

    def _buffer(self, count: int) -> int:
        return COUNT.size + count % NB_BUFFERS * (HEADER.size + self._capacity)


class ControlMemory:
    """The three latest values between server and control process, in an unnamed file that both map.

    The file vanishes when both processes have closed it.
    """

    def __init__(self, descriptor: int) -> None:
        """Map a file that `create_file` made."""
        view = memoryview(mmap.mmap(descriptor, _SIZE))
        reference_at = LatestValue.size(STATE_CAPACITY)
        push_at = reference_at + LatestValue.size(INPUT_CAPACITY)
        self.state = LatestValue(view, STATE_CAPACITY)
        """A pickled `LiveState`, written by the control process."""
        self.reference = LatestValue(view[reference_at:], INPUT_CAPACITY)
        """A pickled `ReferenceCommand`, written by the server."""
        self.push = LatestValue(view[push_at:], INPUT_CAPACITY)
        """A pickled `Push`, written by the server."""


_SIZE = LatestValue.size(STATE_CAPACITY) + 2 * LatestValue.size(INPUT_CAPACITY)


def create_file() -> int:
    """Descriptor of a new file of zeros for a `ControlMemory`, in memory where the system can."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("walk")
    else:
        with tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
    os.ftruncate(descriptor, _SIZE)
    return descriptor
