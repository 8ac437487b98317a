"""What goes between the server and its control process: values in memory that both share, and messages."""

import mmap
import os
import tempfile
from dataclasses import dataclass
from typing import Any

from app.live.slot import Slot

STATE, WISH = 256 * 1024, 1024  # bytes
MAX_MESSAGE = 160 * 1024  # bytes, of a wish, of its answer or of a part of it, which go by a socket


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Of an answer that comes in parts, as a list, so that none of them delays a tick."""

    value: Any = None
    is_last: bool = False
    """With the last one comes no value."""


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
