"""A place in shared memory where one process leaves a value and others read the latest.

Nobody waits: a value goes to the oldest of a few buffers, then the count in front of
them moves on. A reader who was overtaken finds a checksum that does not fit, and looks again.
"""

import struct
import time
import zlib
from dataclasses import dataclass

COUNT = struct.Struct("<Q")
HEADER = struct.Struct("<QdII")  # count, time, length, checksum
NB_BUFFERS = 4
SHORT_WAIT = 1e-4  # [s] until a reader who was overtaken looks again


@dataclass(frozen=True, slots=True)
class Letter:
    """What lies in a slot."""

    count: int
    """Of the letters written so far; 0 for none."""
    at: float
    """When it was written, on `time.perf_counter`, which all processes share [s]."""
    data: bytes


class Slot:
    """Where the latest value wins. One process writes, by one thread at a time; any may read."""

    @staticmethod
    def size(capacity: int) -> int:
        """Bytes of memory for values of up to `capacity` bytes."""
        return COUNT.size + NB_BUFFERS * (HEADER.size + capacity)

    def __init__(self, memory: memoryview, capacity: int) -> None:
        """Lie at the beginning of `memory`, which is zeros before the first value."""
        self._memory, self._capacity = memory, capacity

    @property
    def count(self) -> int:
        """Of the values written so far."""
        return COUNT.unpack_from(self._memory)[0]

    def write(self, data: bytes) -> None:
        """Leave a value.

        Raises:
            ValueError: if it is too long.
        """
        if len(data) > self._capacity:
            raise ValueError(f"{len(data)} bytes in a slot of {self._capacity}")
        count = self.count + 1
        start = self._buffer(count)
        HEADER.pack_into(self._memory, start, count, time.perf_counter(), len(data), zlib.crc32(data))
        self._memory[start + HEADER.size : start + HEADER.size + len(data)] = data
        COUNT.pack_into(self._memory, 0, count)

    def read(self) -> Letter:
        """The latest value."""
        while (count := self.count) > 0:
            start = self._buffer(count)
            found, at, length, checksum = HEADER.unpack_from(self._memory, start)
            data = bytes(self._memory[start + HEADER.size : start + HEADER.size + min(length, self._capacity)])
            if found == count and zlib.crc32(data) == checksum:
                return Letter(count, at, data)
            time.sleep(SHORT_WAIT)
        return Letter(0, 0.0, b"")

    def _buffer(self, count: int) -> int:
        return COUNT.size + count % NB_BUFFERS * (HEADER.size + self._capacity)
