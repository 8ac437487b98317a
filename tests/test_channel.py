"""Shared memory in which the latest value wins."""

import mmap
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from app.live.channel import LatestValue, SharedValue

CAPACITY = 4096

# Writes ever longer runs of one byte, as fast as it can.
WRITER = """
import mmap, sys
from app.live.channel import LatestValue
latest = LatestValue(memoryview(mmap.mmap(int(sys.argv[1]), LatestValue.size(4096))), 4096)
for i in range(1, 60_000):
    latest.write(bytes([i % 251]) * (1 + i % 4096))
"""

# Writes small values to one place as fast as it can, and reads another; both hold their own count.
PARTNER = """
import mmap, sys
from app.live.channel import LatestValue
descriptor, nb = map(int, sys.argv[1:])
size = LatestValue.size(4096)
memory = memoryview(mmap.mmap(descriptor, 2 * size))
written, read = LatestValue(memory, 4096), LatestValue(memory[size:], 4096)
last = 0
for i in range(1, nb + 1):
    written.write(b"%d" % i)
    message = read.read()
    assert message.count >= last and (not message.count or message.data == b"%d" % message.count), (last, message)
    last = message.count
"""


@pytest.fixture
def memory() -> mmap.mmap:
    return mmap.mmap(-1, LatestValue.size(CAPACITY))


@pytest.fixture
def latest(memory) -> LatestValue:
    return LatestValue(memoryview(memory), CAPACITY)


def test_nothing_then_always_the_latest(latest):
    assert latest.read().data == b"" and latest.count == 0
    for i in range(1, 20):
        before = time.perf_counter()
        latest.write(str(i).encode())
        message = latest.read()
        assert (message.count, message.data) == (i, str(i).encode())
        assert before <= message.written_at <= time.perf_counter()


def test_what_is_too_long_is_refused_and_changes_nothing(latest):
    latest.write(b"x" * CAPACITY)
    with pytest.raises(ValueError):
        latest.write(b"y" * (CAPACITY + 1))
    assert latest.read().data == b"x" * CAPACITY


def test_a_value_that_was_half_written_is_not_read(latest, memory, monkeypatch):
    latest.write(b"one")
    latest.write(b"two")
    place = memory.find(b"two")
    memory[place] = ord("x")

    def mend(_: float) -> None:
        memory[place] = ord("t")

    monkeypatch.setattr("app.live.channel.time.sleep", mend)
    assert latest.read().data == b"two"


def test_a_reader_sees_whole_values_only_and_never_an_older_one_again(tmp_path):
    path = tmp_path / "latest"
    path.write_bytes(bytes(LatestValue.size(CAPACITY)))
    with path.open("r+b") as file:
        latest = LatestValue(memoryview(mmap.mmap(file.fileno(), LatestValue.size(CAPACITY))), CAPACITY)
        writer = subprocess.Popen([sys.executable, "-c", WRITER, str(file.fileno())], pass_fds=(file.fileno(),))
        last = 0
        while writer.poll() is None:
            message = latest.read()
            if message.count:
                assert message.data == bytes([message.count % 251]) * (1 + message.count % 4096)
                assert message.count >= last
                last = message.count
            time.sleep(random.uniform(0.0, 1e-5))
        assert writer.returncode == 0 and latest.read().count == 59_999


def hammer(path: Path, nb_values: int) -> None:
    """Write and read in two processes at once, in both directions, until the other has written all of its values."""
    size = LatestValue.size(CAPACITY)
    path.write_bytes(bytes(2 * size))
    with path.open("r+b") as file:
        memory = memoryview(mmap.mmap(file.fileno(), 2 * size))
        read, written = LatestValue(memory, CAPACITY), LatestValue(memory[size:], CAPACITY)
        arguments = [sys.executable, "-c", PARTNER, str(file.fileno()), str(nb_values)]
        partner = subprocess.Popen(arguments, pass_fds=(file.fileno(),), stderr=subprocess.PIPE, text=True)
        last = nb_written = 0
        while nb_written % 10_000 or partner.poll() is None:
            nb_written += 1
            written.write(b"%d" % nb_written)
            for _ in range(8):  # more reads than writes, so that they meet a write at each of its moments
                message, count = read.read(), read.count
                assert last <= message.count <= count
                assert not message.count or message.data == b"%d" % message.count
                last = message.count
        assert partner.wait() == 0, partner.communicate()[1]
        assert read.read().count == nb_values


def test_two_processes_that_write_and_read_at_full_rate_see_whole_values_in_order(tmp_path):
    hammer(tmp_path / "memory", 100_000)


@pytest.mark.exhaustive
def test_two_processes_that_write_and_read_for_long_see_whole_values_in_order(tmp_path):
    hammer(tmp_path / "memory", 5_000_000)


def test_a_reader_that_is_overtaken_for_ever_keeps_the_value_that_it_had(latest, memory, monkeypatch):
    latest.write(b"one")
    assert latest.read().data == b"one"
    latest.write(b"two")
    memory[memory.find(b"two")] = ord("x")
    monkeypatch.setattr("app.live.channel.time.sleep", lambda _: None)
    message = latest.read()
    assert (message.count, message.data) == (1, b"one")


def test_an_object_is_unpickled_once_and_taken_once(memory):
    written, read = (SharedValue[list[int]](memoryview(memory), CAPACITY) for _ in range(2))
    assert read.latest is None and read.take() is None
    for value in ([1], [1], [2]):
        written.write(value)
        assert read.latest == value and read.latest is read.latest
        assert (read.take(), read.take()) == (value, None)
