"""The memory that the server and its control process share: latest state out, latest reference and push in."""

import mmap
import os
import tempfile

from app.slot import Slot

STATE, WISH = 256 * 1024, 1024  # bytes
MAX_MESSAGE = 128 * 1024  # bytes, of a wish or its answer, which go by a socket


class ControlMemory:
    """Three slots in an unnamed file, which goes when both processes have closed it."""

    def __init__(self, descriptor: int) -> None:
        """Map the file, which `create_file` made."""
        self._map = mmap.mmap(descriptor, _SIZE)
        view = memoryview(self._map)
        self.state = Slot(view, STATE)
        """A pickled `LiveState`, written by the control process."""
        self.drive = Slot(view[Slot.size(STATE) :], WISH)
        """A pickled `Drive`, written by the server."""
        self.push = Slot(view[Slot.size(STATE) + Slot.size(WISH) :], WISH)
        """A pickled `Push`, written by the server."""


_SIZE = Slot.size(STATE) + 2 * Slot.size(WISH)


def create_file() -> int:
    """Descriptor of a new file of zeros of the right size, in memory where the system can."""
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("walk")
    else:
        with tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
    os.ftruncate(descriptor, _SIZE)
    return descriptor
