"""The place in shared memory where the latest value wins."""

import mmap
import random
import subprocess
import sys
import time

import pytest

from app.live.slot import HEADER, Slot

CAPACITY = 4096

# Writes ever longer runs of one byte, as fast as it can.
WRITER = """
import mmap, sys
from app.live.slot import Slot
slot = Slot(memoryview(mmap.mmap(int(sys.argv[1]), Slot.size(4096))), 4096)
for i in range(1, 60_000):
    slot.write(bytes([i % 251]) * (1 + i % 4096))
"""


@pytest.fixture
def slot() -> Slot:
    return Slot(memoryview(mmap.mmap(-1, Slot.size(CAPACITY))), CAPACITY)


def test_nothing_then_always_the_latest(slot):
    assert slot.read().data == b"" and slot.count == 0
    for i in range(1, 20):
        before = time.perf_counter()
        slot.write(str(i).encode())
        letter = slot.read()
        assert (letter.count, letter.data) == (i, str(i).encode()) and before <= letter.at <= time.perf_counter()


def test_what_is_too_long_is_refused_and_changes_nothing(slot):
    slot.write(b"x" * CAPACITY)
    with pytest.raises(ValueError):
        slot.write(b"y" * (CAPACITY + 1))
    assert slot.read().data == b"x" * CAPACITY


def test_a_value_that_was_half_written_is_not_read(slot, monkeypatch):
    slot.write(b"one")
    slot.write(b"two")
    slot._memory[slot._buffer(2) + HEADER.size] = ord("x")

    def mend(_: float) -> None:
        slot._memory[slot._buffer(2) + HEADER.size] = ord("t")

    monkeypatch.setattr("app.live.slot.time.sleep", mend)
    assert slot.read().data == b"two"


def test_a_reader_sees_whole_values_only_and_never_an_older_one_again(tmp_path):
    path = tmp_path / "slot"
    path.write_bytes(bytes(Slot.size(CAPACITY)))
    with path.open("r+b") as file:
        slot = Slot(memoryview(mmap.mmap(file.fileno(), Slot.size(CAPACITY))), CAPACITY)
        writer = subprocess.Popen([sys.executable, "-c", WRITER, str(file.fileno())], pass_fds=(file.fileno(),))
        last = 0
        while writer.poll() is None:
            letter = slot.read()
            if letter.count:
                assert letter.data == bytes([letter.count % 251]) * (1 + letter.count % 4096)
                assert letter.count >= last
                last = letter.count
            time.sleep(random.uniform(0.0, 1e-5))
        assert writer.returncode == 0 and slot.read().count == 59_999
