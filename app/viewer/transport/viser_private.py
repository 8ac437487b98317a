"""The only module that uses private names of viser, each with the reason why viser's public API does not serve.

`tests/test_viser_contract.py` fails with the name of whatever a new viser changed. The costs were measured with
the default robot at thirty frames a second (`benchmarks/viewer.py`, with `--public` for the scene's handles).
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import viser
import websockets.asyncio.server
from numpy.typing import NDArray
from viser import _messages
from websockets.asyncio.server import ServerConnection

CLIENT_PAGE = Path(viser.__file__).parent / "client" / "build" / "index.html"
"""Page of viser's client; viser's own server sends it without an ETag, so that browsers load it on every visit."""

# Types of messages, by which a frame is sent past viser's own buffer. Assigning to handles instead takes three times
# the processor time of a frame (four with five browsers), and gives out 1200 message ids a second, all of which viser
# walks through for each browser that joins. Slow readers would get every old frame before the newest.
POSITION = "SetPositionMessage"
ORIENTATION = "SetOrientationMessage"
VISIBILITY = "SetSceneNodeVisibilityMessage"
NODE_PROPERTIES = "SceneNodeUpdateMessage"
CONTROL_PROPERTIES = "GuiUpdateMessage"


def control_id(control: viser.GuiUplotHandle | viser.GuiHtmlHandle | viser.GuiCheckboxHandle) -> str:
    """Id of a control of the panel, which messages about it carry; handles have no public one.

    Assigning to the handles of plots and table instead takes 1.4 times the processor time of a frame with five
    browsers, since viser encodes each plot for each browser.
    """
    return control._impl.uuid


def connections(server: viser.ViserServer) -> Mapping[int, ServerConnection]:
    """Websocket of each client by its id; the public handle of a client neither sends bytes nor has their backlog."""
    return server._websock_server._live_connections


def has_whole_scene(server: viser.ViserServer, client_id: int) -> bool:
    """Whether viser has sent a client every message that it keeps for new ones; nothing public says when."""
    buffer = server._websock_server._broadcast_buffer
    return buffer.generator_cursors.get(client_id, -1) >= buffer.message_counter - 1


@contextmanager
def listening_on(path: Path) -> Iterator[None]:
    """Have the viser server that is made meanwhile listen on a Unix socket; viser itself knows ports only.

    A port of the loopback is open to every user of the machine, and to every page in a browser on it. viser looks
    `websockets.asyncio.server.serve` up when it starts to listen, which it has done when its constructor returns.
    """
    serve = websockets.asyncio.server.serve

    def serve_on_path(handler: Any, _host: str, _port: int, **options: Any) -> Any:
        return serve(handler, unix=True, path=str(path), **options)

    websockets.asyncio.server.serve = serve_on_path  # pyright: ignore[reportAttributeAccessIssue]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = serve


def input_handle(server: viser.ViserServer, uuid: str) -> Any:
    """Control of the panel by its id, None if there is none; nothing public finds a handle by the id in a message."""
    return server.gui._gui_input_handle_from_uuid.get(uuid)


def container(server: viser.ViserServer, uuid: str) -> Any:
    """Form, folder or tab of the panel by its id, None if there is none; see `input_handle`."""
    return server.gui._container_handle_from_uuid.get(uuid)


def command_exists(server: viser.ViserServer, uuid: str) -> bool:
    """Whether a command of the palette has this id; see `input_handle`."""
    return uuid in server.gui._command_handle_from_uuid


def nb_message_ids(server: viser.ViserServer) -> int:
    """Number of message ids that viser has given out, which tests and benchmarks hold still."""
    return server._websock_server._broadcast_buffer.message_counter


def requested_path(server: viser.ViserServer, client_id: int) -> str:
    """Path and query by which a client opened its websocket, "" after it disconnected; its handle does not say."""
    connection = connections(server).get(client_id)
    return "" if connection is None or connection.request is None else connection.request.path


def refuse_tunnels(server: viser.ViserServer) -> None:
    """Take from all clients the right to open a public tunnel; the theme can only hide its button."""
    server._websock_server.unregister_handler(_messages.ShareUrlRequest)


def add_mesh(
    scene: viser.SceneApi,
    name: str,
    vertices: NDArray[np.int16],
    faces: NDArray[np.unsignedinteger],
    step: float,
    **material: Any,
) -> viser.MeshHandle:
    """Add a mesh as `add_mesh_simple` does, but with vertices in whole steps.

    The public way sends floats and long indices: 1.60 MB to a new browser instead of 0.83 MB.

    Args:
        scene: takes the mesh.
        name: path of the node.
        vertices: in steps, shape (V, 3).
        faces: shape (F, 3).
        step: [m].
        material: `color`, `opacity`, `side`, `cast_shadow`, `receive_shadow` of `add_mesh_simple`.
    """
    if not isinstance(scene, viser.SceneApi):  # it stands for one whose nodes exist already, as `past_look` has it
        return scene
    props = _messages.MeshProps(
        vertices=vertices,  # pyright: ignore[reportArgumentType]  # three.js takes any type of number
        faces=faces,  # pyright: ignore[reportArgumentType]
        scale=step,
        wireframe=False,
        flat_shading=False,
        material="standard",
        **material,
    )
    message = _messages.MeshMessage(name, props)
    return viser.MeshHandle._make(scene, message, name, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), True)
