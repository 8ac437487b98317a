"""What browsers are sent: the latest values, once each, and nothing kept."""

import asyncio
import socket
import time
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
import viser
import zstandard
from websockets.asyncio.client import connect

from app.live.runner import LiveState
from app.live.tick_scheduler import TickScheduler
from app.viewer import Viewer
from app.viewer.transport.stream import Stream
from app.viewer.transport.wire import Encoder
from walkcore import Command, Parameters, Reference, Simulation, load_robot

HEADER = 16
PATIENCE = 60.0  # [s]
PROTOCOL: Any = f"viser-v{viser.__version__}"
TYPES = {"<f4": np.float32, "<f8": np.float64, "<i2": np.int16, "<u2": np.uint16, "<u4": np.uint32, "|u1": np.uint8}


def decoded(batch: bytes) -> list[dict[str, Any]]:
    """As a browser reads it."""
    size = int.from_bytes(batch[8:HEADER], "little")
    content = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(batch[HEADER : HEADER + size]))
    arrays, at = [], HEADER + size
    for length in content["binaryBufferLengths"]:
        at += -at % 8
        arrays.append(batch[at : at + length])
        at += length
    assert at == len(batch)

    def restored(value: Any) -> Any:
        if isinstance(value, dict) and "__binary_index" in value:
            return np.frombuffer(arrays[value["__binary_index"]], TYPES[value["dtype"]])
        if isinstance(value, dict):
            return {key: restored(item) for key, item in value.items()}
        return [restored(item) for item in value] if isinstance(value, list) else value

    return [restored(message) for message in content["messages"]]


def test_only_what_changed_is_sent():
    stream = Stream()
    stream.position("/a", (0.0, 1.0, 2.0))
    stream.visible("/b", True)
    assert {message["name"] for message in stream.changes(0)} == {"/a", "/b"}
    stream.next_frame()
    stream.position("/a", (0.0, 1.0, 2.0 + 1e-7))  # less than a hundredth of a millimetre
    stream.visible("/b", False)
    assert stream.changes(1) == [{"type": "SetSceneNodeVisibilityMessage", "name": "/b", "visible": False, "owner": ""}]


def test_who_was_left_out_gets_the_latest_of_all_that_changed_meanwhile():
    stream = Stream()
    for x in range(5):
        stream.position("/a", (x, 0.0, 0.0))
        stream.visible(f"/{x}", True)
        stream.next_frame()
    messages = stream.changes(3)
    assert [message["position"][0] for message in messages if message["name"] == "/a"] == [4.0]
    assert {message["name"] for message in messages} == {"/a", "/3", "/4"}
    assert len(stream.changes(0)) == 6


def test_properties_of_one_node_go_in_one_message_with_their_arrays():
    stream = Stream()
    points = np.arange(6, dtype=np.float32)
    stream.properties("/line", points=points, visible=True)
    stream.control("uuid", data=(np.arange(3, dtype=np.float32), np.ones(3, dtype=np.float32)))
    line, plot = decoded(Encoder().encode(stream.changes(0)))
    assert line["type"] == "SceneNodeUpdateMessage" and line["updates"]["visible"] is True
    assert np.array_equal(line["updates"]["points"], points)
    assert plot["uuid"] == "uuid" and np.array_equal(plot["updates"]["data"], [[0, 1, 2], [1, 1, 1]])


class Replay:
    """In place of the runner: a walk that goes on each time somebody looks."""

    def __init__(self) -> None:
        self.robot, self.parameters = load_robot("hrp2"), Parameters()
        self.defaults = self.parameters
        simulation = Simulation(self.robot, self.parameters)
        self._snapshots = [simulation.step(Command(Reference(vx=0.2))) for _ in range(400)]
        self._state = LiveState(self._snapshots[0], TickScheduler(0.005).timing, True, "rest")
        self.looks = 0

    @property
    def latest(self) -> LiveState:
        self.looks += 1
        return replace(self._state, snapshot=self._snapshots[4 * self.looks % len(self._snapshots)])

    def preview(self, _: Any) -> Future[Any]:
        return Future()

    def drive(self, *_: Any) -> None:
        raise AssertionError("nobody drives")


@pytest.fixture
def viewer() -> Iterator[Viewer]:
    viewer = Viewer(Replay())  # pyright: ignore[reportArgumentType]
    viewer.start()
    yield viewer
    viewer.stop()


async def read(port: int, nb_batches: int) -> list[dict[str, Any]]:
    """The messages of a new client: all of the beginning, then so many batches."""
    async with connect(f"ws://127.0.0.1:{port}", subprotocols=[PROTOCOL], compression=None, max_size=None) as socket:
        messages: list[dict[str, Any]] = []
        while not any(message["type"] == "ReplayDoneMessage" for message in messages):
            messages += decoded(await asyncio.wait_for(socket.recv(decode=False), PATIENCE))
        for _ in range(nb_batches):
            messages += decoded(await asyncio.wait_for(socket.recv(decode=False), PATIENCE))
        return messages


def test_late_browser_gets_every_node_before_what_moves_it_and_nothing_was_kept_for_it(viewer):
    buffer = viewer._server._websock_server._broadcast_buffer
    asyncio.run(read(viewer.port, 20))  # until the sliders show what is asked
    before = buffer.message_counter

    messages = asyncio.run(read(viewer.port, 30))
    assert buffer.message_counter == before
    made = [
        message["name"]
        for message in messages
        if message["type"].endswith("Message") and "props" in message and "name" in message
    ]
    done = next(i for i, message in enumerate(messages) if message["type"] == "ReplayDoneMessage")
    moved = {message["name"] for message in messages[done + 1 :] if "name" in message}
    assert moved and moved <= set(made)
    positions = [
        message["position"] for message in messages[done:] if message.get("name") == "/w" and "position" in message
    ]
    assert len(positions) > 20 and positions == sorted(positions, reverse=True)  # the world goes back below the robot


def test_nothing_is_drawn_while_nobody_looks(viewer):
    asyncio.run(read(viewer.port, 3))
    while len(viewer._audience):
        time.sleep(0.01)
    time.sleep(0.1)  # the frame under way
    looks = viewer._runner.looks
    time.sleep(0.3)
    assert viewer._runner.looks == looks


def slow_reader(port: int) -> socket.socket:
    """A connection that holds as little on its way as one through the proxy does."""
    end = socket.socket()
    end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    end.connect(("127.0.0.1", port))
    end.setblocking(False)
    return end


def test_browser_that_does_not_read_is_left_out_and_catches_up_with_the_latest(viewer):
    async def stall() -> tuple[int, int]:
        uri, end = f"ws://127.0.0.1:{viewer.port}", slow_reader(viewer.port)
        async with connect(
            uri, sock=end, subprotocols=[PROTOCOL], compression=None, max_size=None, max_queue=1
        ) as reader:
            while not any(m["type"] == "ReplayDoneMessage" for m in decoded(await reader.recv(decode=False))):
                pass
            while not viewer._audience._seen:
                await asyncio.sleep(0.01)
            (client,) = viewer._audience._seen
            reader.transport.pause_reading()
            while viewer._scene.stream.frame - viewer._audience._seen[client] < 10:
                await asyncio.sleep(0.01)
            left_out_since = viewer._audience._seen[client]
            reader.transport.resume_reading()
            while viewer._audience._seen[client] == left_out_since:
                await reader.recv(decode=False)
            return left_out_since, viewer._audience._seen[client]

    left_out_since, latest = asyncio.run(asyncio.wait_for(stall(), PATIENCE))
    assert latest >= left_out_since + 10
