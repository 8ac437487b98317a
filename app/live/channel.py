"""Memory that the server and its control process share: for each direction the latest value, and nothing older.

Nobody waits: a value goes to the oldest
of a few buffers, then the count in front of them moves on. Each buffer is a sequence lock: its number is cleared before
the value changes and set after it, and a reader that finds another number than the count, or a checksum that does not
fit, was overtaken and reads again. Count and numbers are single words of the machine, which are written and read
whole: `struct.pack_into` would write them byte by byte, over zeros.
"""

import mmap
import os
import struct
import tempfile
import time
import zlib
from dataclasses import dataclass

STATE_CAPACITY, INPUT_CAPACITY = 256 * 1024, 1024  # bytes
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
