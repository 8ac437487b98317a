"""Who comes by the path for light clients gets a sun of its own, without shadows."""

import time
from collections.abc import Iterator

import msgspec
import pytest
import viser
from viser import _messages
from websockets.sync.client import connect

from app.viewer.scene.scene import add_key_light
from app.viewer.transport.light_clients import LIGHT_PATH, spare_light_clients
from app.viewer.transport.visitors import Visitors

CAMERA = _messages.ViewerCameraMessage(
    (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.7, 0.1, 10.0, 100, 100, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
)
PATIENCE = 20.0  # [s]
SETTLED = 0.5  # [s] after which a client has what it gets of its own


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    spare_light_clients(server)
    add_key_light(server.scene, has_shadows=True)
    yield server
    server.stop()


def own_suns(server: viser.ViserServer, path: str) -> list[bool]:
    """Whether each sun that only the client of this path sees casts shadows."""
    address = f"ws://127.0.0.1:{server.get_port()}{path}"
    earlier = set(server.get_clients())  # which may not have noticed that they are gone
    with connect(address, subprotocols=[f"viser-v{viser.__version__}"], max_size=None) as browser:
        browser.send(msgspec.msgpack.encode(CAMERA.as_serializable_dict()))
        end = time.monotonic() + PATIENCE
        while not (new := set(server.get_clients()) - earlier):
            assert time.monotonic() < end
            time.sleep(0.02)
        time.sleep(SETTLED)
        nodes = server.get_clients()[new.pop()].scene._handle_from_node_name
        return [nodes[name].cast_shadow for name in nodes if name == "/light/key"]


def test_only_light_clients_are_spared_the_shadows(server):
    assert own_suns(server, "/") == []
    assert own_suns(server, f"{LIGHT_PATH}?client=mine") == [False]


def test_scene_tells_which_page_it_belongs_to_until_it_is_gone(server):
    visitors = Visitors(server)
    seen: list[str] = []
    server.on_client_connect(lambda client: seen.append(visitors.page(client)))
    own_suns(server, "/?client=mine")
    assert seen == ["mine"]
    end = time.monotonic() + PATIENCE
    while visitors.is_here("mine"):
        assert time.monotonic() < end
        time.sleep(0.02)
    own_suns(server, "/")
    assert seen == ["mine", ""]
