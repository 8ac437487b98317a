"""Contract with viser's private names: each test names what a new viser changed of `viser_private.py`'s assumptions."""

import ast
import dataclasses
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import viser
from conftest import PATIENCE, wait_for
from scene_reader import PROTOCOL, SceneSocket, decoded
from viser import _messages
from websockets.sync.client import unix_connect

from app.viewer.transport import viser_private
from app.viewer.transport.broadcaster import Encoder
from app.viewer.transport.scene_updates import SceneUpdates

VIEWER = Path(viser_private.__file__).parent.parent


def changed(what: str) -> str:
    return f"viser {viser.__version__} changed {what}: adapt app/viewer/transport/viser_private.py"


def fields(kind: str) -> list[str]:
    message = getattr(_messages, kind, None)
    assert message is not None, changed(f"its messages: there is no {kind}")
    return [field.name for field in dataclasses.fields(message)]


@pytest.mark.parametrize(
    ("kind", "expected"),
    {
        "SetPositionMessage": ["name", "position"],
        "SetOrientationMessage": ["name", "wxyz"],
        "SetSceneNodeVisibilityMessage": ["name", "visible"],
        "SceneNodeUpdateMessage": ["name", "updates"],
        "GuiUpdateMessage": ["uuid", "updates"],
        "MeshMessage": ["name", "props"],
        "ShareUrlRequest": [],
    }.items(),
)
def test_messages_have_the_fields_that_are_sent(kind, expected):
    assert set(expected) <= set(fields(kind)), changed(f"the fields of {kind}, which are now {fields(kind)}")


def test_meshes_have_the_properties_that_are_sent():
    expected = {"vertices", "faces", "color", "wireframe", "opacity", "flat_shading", "side", "material", "scale"}
    found = set(fields("MeshProps"))
    assert found == expected | {"cast_shadow", "receive_shadow"}, changed(f"MeshProps to {sorted(found)}")


def test_mesh_handles_are_made_from_messages():
    make: Any = getattr(viser.MeshHandle, "_make", None)
    assert make is not None, changed("MeshHandle: there is no _make")
    names = list(inspect.signature(make).parameters)
    assert names[:6] == ["api", "message", "name", "wxyz", "position", "visible"], changed(f"MeshHandle._make: {names}")


def test_client_page_is_where_it_was():
    assert viser_private.CLIENT_PAGE.is_file(), changed("the place of its client's page")
    assert b"<title>Viser</title>" in viser_private.CLIENT_PAGE.read_bytes(), changed("the title of its client's page")


def test_server_has_the_attributes_that_are_read(viser_server):
    inside: Any = getattr(viser_server, "_websock_server", None)
    assert inside is not None, changed("ViserServer: there is no _websock_server")
    for name, kind in (("_live_connections", dict), ("_incoming_handlers", dict)):
        assert isinstance(getattr(inside, name, None), kind), changed(
            f"its WebsockServer: {name} is no {kind.__name__}"
        )
    buffer = getattr(inside, "_broadcast_buffer", None)
    for name, kind in (("generator_cursors", dict), ("message_counter", int)):
        assert isinstance(getattr(buffer, name, None), kind), changed(
            f"its message buffer: {name} is no {kind.__name__}"
        )


def test_no_client_can_open_a_tunnel(viser_server):
    handlers = viser_server._websock_server._incoming_handlers
    assert _messages.ShareUrlRequest in handlers, changed("the handler of ShareUrlRequest")
    viser_private.refuse_tunnels(viser_server)
    assert _messages.ShareUrlRequest not in handlers, changed("unregister_handler")


def browser(server: viser.ViserServer, path: str = "/") -> SceneSocket:
    return SceneSocket(f"ws://127.0.0.1:{server.get_port()}{path}")


def test_a_client_is_known_by_its_path_and_has_the_whole_scene_after_the_end_of_the_replay(viser_server):
    for k in range(300):  # more than one window of messages
        viser_server.scene.add_frame(f"/frame_{k}")
    with browser(viser_server, "/light?client=mine") as end:
        end.beginning()
        ((client, connection),) = viser_private.connections(viser_server).items()
        assert viser_private.requested_path(viser_server, client) == "/light?client=mine", changed("requests")
        assert connection.transport.get_write_buffer_size() == 0, changed("the connections of clients")
        assert viser_private.has_whole_scene(viser_server, client), changed("generator_cursors or message_counter")
    wait_for(lambda: not viser_private.connections(viser_server))
    assert viser_private.requested_path(viser_server, client) == ""
    assert not viser_private.has_whole_scene(viser_server, client), changed("generator_cursors: they stay")


POINTS = np.ones((2, 2, 3), dtype=np.float32)
CHANGES: dict[str, tuple[str, Any, Callable[[SceneUpdates, Any], None]]] = {
    "SetPositionMessage": ("position", (1.0, 2.0, 3.0), lambda updates, value: updates.position("/lines", value)),
    "SetOrientationMessage": (
        "wxyz",
        (0.0, 1.0, 0.0, 0.0),
        lambda updates, value: updates.orientation("/lines", value),
    ),
    "SetSceneNodeVisibilityMessage": ("visible", False, lambda updates, value: updates.visible("/lines", value)),
    "SceneNodeUpdateMessage": ("points", POINTS, lambda updates, value: updates.properties("/lines", points=value)),
}


def sent_by_viser(server: viser.ViserServer, kind: str, handle: Any, field: str, value: Any) -> dict[str, Any]:
    """Message that viser sends when a property of a handle is assigned."""
    with browser(server) as end:
        end.beginning()
        setattr(handle, field, value)
        return plain(end.first(kind))


@pytest.mark.parametrize("kind", CHANGES)
def test_messages_are_encoded_as_viser_encodes_them(viser_server, kind):
    lines, updates = viser_server.scene.add_line_segments("/lines", 0.0 * POINTS, (0, 0, 0)), SceneUpdates()
    field, value, change = CHANGES[kind]
    change(updates, value)
    (ours,) = decoded(Encoder().encode(updates.changes(0)))
    assert plain(ours) == sent_by_viser(viser_server, kind, lines, field, value), changed(f"{kind} or a batch")


def test_controls_are_updated_as_viser_updates_them(viser_server):
    table, updates = viser_server.gui.add_html(""), SceneUpdates()
    assert hasattr(table, "_impl") and hasattr(table._impl, "uuid"), changed("the id of controls: _impl.uuid")
    updates.control(table, content="new")
    (ours,) = decoded(Encoder().encode(updates.changes(0)))
    theirs = sent_by_viser(viser_server, "GuiUpdateMessage", table, "content", "new")
    assert plain(ours) == theirs, changed("GuiUpdateMessage or a batch")


def plain(value: Any) -> Any:
    """Arrays as lists, to compare them."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value


def test_quantised_mesh_is_the_mesh_of_the_public_way(viser_server):
    vertices, faces = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0]], dtype=np.int16), np.array([[0, 1, 2]], np.uint16)
    look: dict[str, Any] = {"color": (1, 2, 3), "opacity": 0.5, "side": "double", "cast_shadow": True}
    look["receive_shadow"] = False
    viser_private.add_mesh(viser_server.scene, "/ours", vertices, faces, 0.25, **look)
    viser_server.scene.add_mesh_simple("/theirs", 0.25 * vertices, faces, **look)
    with browser(viser_server) as end:
        messages = end.beginning()
        ours, theirs = (
            next(m for m in messages if m.get("name") == name and m["type"] == "MeshMessage")["props"]
            for name in ("/ours", "/theirs")
        )
    assert ours["vertices"].reshape(-1, 3) * ours["scale"] == pytest.approx(theirs["vertices"].reshape(-1, 3))
    assert ours["faces"].tolist() == theirs["faces"].tolist()
    assert ours["vertices"].dtype == np.int16, changed("the types of vertices that it sends")
    others = set(ours) - {"vertices", "faces", "scale"}
    assert {key: ours[key] for key in others} == {key: theirs[key] for key in others}, changed("add_mesh_simple")


def private_names(path: Path) -> set[str]:
    """Names with an underscore in front that a file takes from other objects or modules."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
            if not (isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")):
                found.add(node.attr)
        elif isinstance(node, ast.ImportFrom):
            parts = [*str(node.module).split("."), *(alias.name for alias in node.names)]
            found |= {part for part in parts if part.startswith("_")}
    return found


def test_only_one_module_uses_private_names_of_viser():
    using = {path.name for path in VIEWER.rglob("*.py") if private_names(path)}
    assert using == {"viser_private.py"}


def test_controls_forms_and_commands_are_found_by_the_ids_in_messages(viser_server):
    box = viser_server.gui.add_checkbox("box", False)
    with viser_server.gui.add_form(None) as form:
        pass
    command: Any = viser_server.gui.add_command("command")
    with browser(viser_server) as end:
        ids: Any = {message["type"]: message.get("uuid") for message in end.beginning()}
    assert viser_private.input_handle(viser_server, ids["GuiCheckboxMessage"]) is box, changed("the handles by id")
    assert viser_private.container(viser_server, ids["GuiFormMessage"]) is form, changed("the containers by id")
    assert viser_private.command_exists(viser_server, ids["RegisterCommandMessage"]), changed("the commands by id")
    assert viser_private.input_handle(viser_server, "") is None and command is not None


def test_a_server_can_be_made_to_listen_on_a_unix_socket(tmp_path):
    with viser_private.listening_on(tmp_path / "socket"):
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        assert (tmp_path / "socket").is_socket(), changed("how it begins to listen: websockets' serve")
        with unix_connect(str(tmp_path / "socket"), subprotocols=[PROTOCOL], compression=None, max_size=None) as end:
            assert decoded(end.recv(timeout=PATIENCE))  # pyright: ignore[reportArgumentType]
    finally:
        server.stop()
