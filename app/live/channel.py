"""Memory that the server and its control process share: for each direction the latest value, and nothing older.

Nobody waits: a value goes to the oldest of a few buffers, then the count in front of them moves on. Each buffer is a
sequence lock: its number is cleared before the value changes and set after it, and a reader that finds another number
than the count, or a checksum that does not fit, was overtaken and reads again. Count and numbers are single words of
the machine, which are written and read whole: `struct.pack_into` would write them byte by byte, over zeros.
"""

import mmap
import os
import pickle
import struct
import tempfile
import time
import zlib
from dataclasses import dataclass
from typing import Generic, TypeVar

from app.live.live_state import LiveState, ReferenceCommand
from walkcore import Parameters, Push

T = TypeVar("T")

STATE_CAPACITY, SMALL_CAPACITY = 256 * 1024, 4096  # bytes of a state, and of all else
WORD = 8  # bytes
HEADER = struct.Struct("<QdQ")  # count, time, length: what the checksum covers beside the value
NB_BUFFERS = 4
MAX_READS = 100  # of a reader that is overtaken each time, which then keeps the value that it had
RETRY_PERIOD = 1e-4  # [s] until a reader that was overtaken reads again


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
        """Bytes of memory that values of up to `capacity` bytes need, a multiple of a word."""
        return WORD + NB_BUFFERS * _buffer_size(capacity)

    def __init__(self, memory: memoryview, capacity: int) -> None:
        """Use the beginning of a memory.

        Args:
            memory: zeros before the first value is written; it begins at a multiple of a word.
            capacity: bytes of the longest value.
        """
        self._memory, self._capacity = memory[: self.size(capacity)], capacity
        self._words = self._memory.cast("Q")
        self._read = Message(0, 0.0, b"")

    @property
    def count(self) -> int:
        """Number of values written so far."""
        return self._words[0]

    def write(self, data: bytes) -> None:
        """Replace the value.

        Raises:
            ValueError: if it is longer than the capacity.
        """
        if len(data) > self._capacity:
            raise ValueError(f"{len(data)} bytes where {self._capacity} fit")
        count = self.count + 1
        start = self._buffer(count)
        header = HEADER.pack(count, time.perf_counter(), len(data))
        body = start + 2 * WORD
        self._words[start // WORD] = 0
        self._memory[body : body + HEADER.size] = header
        self._memory[body + HEADER.size : body + HEADER.size + len(data)] = data
        self._words[start // WORD + 1] = zlib.crc32(data, zlib.crc32(header))
        self._words[start // WORD] = count
        self._words[0] = count

    def read(self) -> Message:
        """The latest value, never an older one than at the last reading."""
        for _ in range(MAX_READS):
            count, last = self.count, self._read
            if count <= last.count:  # nothing new; less is what another thread has already read
                return last
            if (message := self._copy(count)) is not None:
                self._read = message
                return message
            time.sleep(RETRY_PERIOD)
        return self._read

    def _copy(self, count: int) -> Message | None:
        """The value of that number; None if it was overwritten before or while it was copied."""
        start = self._buffer(count)
        body = start + 2 * WORD
        if self._words[start // WORD] != count:
            return None
        header, checksum = bytes(self._memory[body : body + HEADER.size]), self._words[start // WORD + 1]
        found, written_at, length = HEADER.unpack(header)
        data = bytes(self._memory[body + HEADER.size : body + HEADER.size + min(length, self._capacity)])
        is_whole = self._words[start // WORD] == count == found and zlib.crc32(data, zlib.crc32(header)) == checksum
        return Message(count, written_at, data) if is_whole else None

    def _buffer(self, count: int) -> int:
        return WORD + count % NB_BUFFERS * _buffer_size(self._capacity)


def _buffer_size(capacity: int) -> int:
    """Bytes of a buffer: its number, its checksum, the header, and the value, to whole words."""
    return 2 * WORD + HEADER.size + -(-capacity // WORD) * WORD


class SharedValue(Generic[T]):
    """An object in shared memory, of which the latest wins: pickled by who writes it, unpickled once by who reads."""

    def __init__(self, memory: memoryview, capacity: int) -> None:
        """Use the beginning of a memory, as `LatestValue` does."""
        self._shared = LatestValue(memory, capacity)
        self._read: tuple[int, T | None] = 0, None
        self._taken: T | None = None

    def write(self, value: T) -> None:
        """Replace the value."""
        self._shared.write(pickle.dumps(value, pickle.HIGHEST_PROTOCOL))

    @property
    def latest(self) -> T | None:
        """The latest value, the same object until there is a newer one; None before the first."""
        message, (count, value) = self._shared.read(), self._read
        if message.count != count:
            value = pickle.loads(message.data)
            self._read = message.count, value
        return value

    @property
    def written_at(self) -> float:
        """Time at which the latest value was written, as in `Message` [s]; 0 before the first."""
        return self._shared.read().written_at

    def take(self) -> T | None:
        """The latest value the first time that it is asked for, None afterwards. Belongs to one thread."""
        before, self._taken = self._taken, self.latest
        return None if self._taken is before else self._taken


class ControlMemory:
    """The latest values between server and control process, in an unnamed file that both map.

    The file vanishes when both processes have closed it.
    """

    def __init__(self, descriptor: int) -> None:
        """Map a file that `create_file` made."""
        view = memoryview(mmap.mmap(descriptor, _SIZE))
        small = [view[LatestValue.size(STATE_CAPACITY) + i * LatestValue.size(SMALL_CAPACITY) :] for i in range(3)]
        self.state = SharedValue[LiveState](view, STATE_CAPACITY)
        """Written by the control process, after each tick and each request."""
        self.parameters = SharedValue[Parameters](small[0], SMALL_CAPACITY)
        """Written by the control process, once others are in force than it began with."""
        self.reference = SharedValue[ReferenceCommand](small[1], SMALL_CAPACITY)
        """Written by the server."""
        self.push = SharedValue[Push](small[2], SMALL_CAPACITY)
        """Written by the server."""


_SIZE = LatestValue.size(STATE_CAPACITY) + 3 * LatestValue.size(SMALL_CAPACITY)


def create_file() -> int:
    """Descriptor of a new file of zeros for a `ControlMemory`, in memory where the system can."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("walk")
    else:
        with tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
    os.ftruncate(descriptor, _SIZE)
    return descriptor
