"""Transport of the scene to browsers: the latest values, once each, and nothing kept; and who the browsers are."""

import asyncio
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
import viser
from conftest import PATIENCE, wait_for
from scene_reader import CAMERA, PROTOCOL, SceneSocket, decoded
from websockets.asyncio.client import unix_connect

from app.live.live_state import LiveState
from app.live.tick_scheduler import TickScheduler
from app.viewer import LIGHT_PATH, Viewer
from app.viewer.scene.scene import add_key_light
from app.viewer.transport import broadcaster
from app.viewer.transport.broadcaster import Broadcaster, Encoder
from app.viewer.transport.client_registry import ClientRegistry
from app.viewer.transport.scene_updates import SceneUpdates
from app.viewer.transport.viser_private import nb_message_ids
from app.viewer.viewer import spare_light_clients
from walkcore import Command, Parameters, Reference, Simulation, load_robot

SETTLED = 0.5  # [s] after which a client has what it gets of its own


def test_only_what_changed_is_sent():
    updates = SceneUpdates()
    updates.position("/a", (0.0, 1.0, 2.0))
    updates.visible("/b", True)
    assert {message["name"] for message in updates.changes(0)} == {"/a", "/b"}
    updates.next_frame()
    updates.position("/a", (0.0, 1.0, 2.0 + 1e-7))  # less than a hundredth of a millimetre
    updates.visible("/b", False)
    assert updates.changes(1) == [
        {"type": "SetSceneNodeVisibilityMessage", "name": "/b", "visible": False, "owner": ""}
    ]


def test_client_that_was_left_out_gets_the_latest_of_all_that_changed_meanwhile():
    updates = SceneUpdates()
    for x in range(5):
        updates.position("/a", (x, 0.0, 0.0))
        updates.visible(f"/{x}", True)
        updates.next_frame()
    messages = updates.changes(3)
    assert [message["position"][0] for message in messages if message["name"] == "/a"] == [4.0]
    assert {message["name"] for message in messages} == {"/a", "/3", "/4"}
    assert len(updates.changes(0)) == 6


def test_properties_of_one_node_go_in_one_message_with_their_arrays(viser_server):
    updates = SceneUpdates()
    points = np.arange(6, dtype=np.float32)
    updates.properties("/line", points=points, visible=True)
    plot = viser_server.gui.add_uplot((np.zeros(2), np.zeros(2)), (viser.uplot.Series(), viser.uplot.Series()))
    updates.control(plot, data=(np.arange(3, dtype=np.float32), np.ones(3, dtype=np.float32)))
    line, data = decoded(Encoder().encode(updates.changes(0)))
    assert line["type"] == "SceneNodeUpdateMessage" and line["updates"]["visible"] is True
    assert np.array_equal(line["updates"]["points"], points)
    assert data["type"] == "GuiUpdateMessage" and np.array_equal(data["updates"]["data"], [[0, 1, 2], [1, 1, 1]])


class Replay:
    """Stand-in for the runner: a walk that goes on each time its state is read."""

    def __init__(self) -> None:
        self.robot, self.parameters = load_robot("hrp2"), Parameters()
        self.defaults = self.parameters
        simulation = Simulation(self.robot, self.parameters)
        self._snapshots = [simulation.step(Command(Reference(vx=0.2))) for _ in range(400)]
        self._state = LiveState(self._snapshots[0], TickScheduler(0.005).timing, True, "rest")
        self.nb_reads = 0

    @property
    def latest(self) -> LiveState:
        self.nb_reads += 1
        return replace(self._state, snapshot=self._snapshots[4 * self.nb_reads % len(self._snapshots)])

    def look(self) -> LiveState:
        return self.latest

    def preview(self, _: Any) -> Future[Any]:
        return Future()

    def drive(self, *_: Any) -> None:
        raise AssertionError("nobody drives")


@pytest.fixture
def runner() -> Replay:
    return Replay()


@pytest.fixture
def viewer(runner: Replay) -> Iterator[Viewer]:
    viewer = Viewer(runner)  # pyright: ignore[reportArgumentType]
    viewer.start()
    yield viewer
    viewer.stop()


async def read(path: Path, nb_batches: int) -> list[dict[str, Any]]:
    """The messages of a new client: all of the beginning, then so many batches."""
    async with unix_connect(str(path), subprotocols=[PROTOCOL], compression=None, max_size=None) as socket:
        messages: list[dict[str, Any]] = []
        while not any(message["type"] == "ReplayDoneMessage" for message in messages):
            messages += decoded(await asyncio.wait_for(socket.recv(decode=False), PATIENCE))
        for _ in range(nb_batches):
            messages += decoded(await asyncio.wait_for(socket.recv(decode=False), PATIENCE))
        return messages


def test_late_browser_gets_every_node_before_what_moves_it_and_nothing_was_kept_for_it(viewer):
    asyncio.run(read(viewer.socket, 20))  # until the sliders show what is asked
    before = nb_message_ids(viewer.server)

    messages = asyncio.run(read(viewer.socket, 30))
    assert nb_message_ids(viewer.server) == before
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


def test_nothing_is_drawn_without_a_client(viewer, runner):
    asyncio.run(read(viewer.socket, 3))
    wait_for(lambda: not viewer.broadcaster.nb_clients)

    def reads_no_more() -> bool:
        nb_reads = runner.nb_reads
        time.sleep(0.3)
        return runner.nb_reads == nb_reads

    wait_for(reads_no_more)


def test_browser_that_does_not_read_is_left_out_and_catches_up_with_the_latest(viewer):
    async def stall() -> tuple[int, int]:
        async with unix_connect(
            str(viewer.socket), subprotocols=[PROTOCOL], compression=None, max_size=None, max_queue=1
        ) as reader:
            while not any(m["type"] == "ReplayDoneMessage" for m in decoded(await reader.recv(decode=False))):
                pass
            while not viewer.broadcaster.last_sent:
                await asyncio.sleep(0.01)
            (client,) = viewer.broadcaster.last_sent
            reader.transport.pause_reading()
            while viewer.scene.updates.frame - viewer.broadcaster.last_sent[client] < 10:
                await asyncio.sleep(0.01)
            left_out_since = viewer.broadcaster.last_sent[client]
            reader.transport.resume_reading()
            while viewer.broadcaster.last_sent[client] == left_out_since:
                await reader.recv(decode=False)
            return left_out_since, viewer.broadcaster.last_sent[client]

    left_out_since, latest = asyncio.run(asyncio.wait_for(stall(), PATIENCE))
    assert latest >= left_out_since + 10


@pytest.fixture
def clients(viser_server) -> ClientRegistry:
    """Registry of a server with a sun for all, and another one for light clients."""
    clients = ClientRegistry(viser_server)
    spare_light_clients(viser_server, clients)
    add_key_light(viser_server.scene, has_shadows=True)
    return clients


def own_suns(server: viser.ViserServer, path: str, is_settled: Callable[[Any], bool] | None = None) -> list[bool]:
    """Shadows of the suns that only the client of this path has, True where a sun casts them.

    Args:
        server: that it opens.
        path: of its websocket.
        is_settled: tells from the client's handle that it has what it gets of its own; by default some time has to do.
    """
    address = f"ws://127.0.0.1:{server.get_port()}{path}"
    earlier = set(server.get_clients())  # which may not have noticed that they are gone
    with SceneSocket(address) as browser:
        browser.send(CAMERA)
        wait_for(lambda: bool(set(server.get_clients()) - earlier))
        (new,) = set(server.get_clients()) - earlier
        client = server.get_clients()[new]
        if is_settled is None:
            time.sleep(SETTLED)
        else:
            wait_for(lambda: is_settled(client))
        sun: Any = client.scene.get_handle_by_name("/light/key")
        return [] if sun is None else [sun.cast_shadow]


def has_sun(client: viser.ClientHandle) -> bool:
    return client.scene.get_handle_by_name("/light/key") is not None


@pytest.mark.usefixtures("clients")
def test_only_light_clients_are_spared_the_shadows(viser_server):
    assert own_suns(viser_server, "/") == []
    assert own_suns(viser_server, f"{LIGHT_PATH}?client=mine", has_sun) == [False]


def test_scene_tells_which_page_it_belongs_to_until_it_is_closed(viser_server, clients):
    pages: list[str] = []
    viser_server.on_client_connect(lambda client: pages.append(clients.page(client.client_id)))
    own_suns(viser_server, "/?client=mine", lambda _: pages == ["mine"])
    wait_for(lambda: not clients.is_open("mine"))
    own_suns(viser_server, "/", lambda _: pages == ["mine", ""])


def test_what_is_a_clients_own_comes_once_and_again_after_another_scene(monkeypatch):
    """A client that was shown another scene has its layers: all of its own are sent again, the latest values."""
    transport = SimpleNamespace(is_closing=lambda: False, get_write_buffer_size=lambda: 0)
    sent: list[list[Any]] = []
    connection = SimpleNamespace(transport=transport)
    monkeypatch.setattr(broadcaster, "connections", lambda _: {0: connection, 1: connection})
    monkeypatch.setattr(broadcaster, "broadcast", lambda _, batch: sent.append(decoded(batch)))
    server: Any = None
    sender = Broadcaster(server)
    sender.last_sent = {0: -1, 1: -1}  # both have viser's own messages
    shared, past, own, none = (SceneUpdates() for _ in range(4))
    shared.position("/robot", (1.0, 0.0, 0.0))
    past.position("/robot", (2.0, 0.0, 0.0))

    def names(others: Any = MappingProxyType({})) -> list[list[str]]:
        sent.clear()
        sender.send(shared, others, lambda client: none if client else own)
        return [[message["name"] for message in batch] for batch in sent]

    own.visible("/a", True)
    own.visible("/b", True)
    assert names() == [["/robot"], ["/a", "/b"]]
    assert names() == []
    own.visible("/b", False)
    assert names() == [["/b"]]
    assert names({0: past}) == [["/robot"], ["/a", "/b"]]
    assert names({0: past}) == []
    assert names() == [["/robot"], ["/a", "/b"]] and sent[1][1]["visible"] is False
