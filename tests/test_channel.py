"""Shared memory in which the latest value wins."""

import mmap
import random
import subprocess
import sys
import time

import pytest

from app.live.channel import LatestValue

CAPACITY = 4096

# Writes ever longer runs of one byte, as fast as it can.
WRITER = """
import mmap, sys
from app.live.channel import LatestValue
latest = LatestValue(memoryview(mmap.mmap(int(sys.argv[1]), LatestValue.size(4096))), 4096)
for i in range(1, 60_000):
    latest.write(bytes([i % 251]) * (1 + i % 4096))
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
