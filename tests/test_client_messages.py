"""Messages of browsers to viser: what an honest browser sends passes, whatever else is sent does not reach viser."""

import math
import os
import stat
from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np
import psutil
import pytest
import viser
from conftest import Server, serving, wait_for
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scene_reader import CAMERA, SceneSocket, controls
from viser import _messages
from websockets.exceptions import ConnectionClosed

from app.http.scene_proxy import COST_OF_CONTROLS
from app.http.turns import BURST, MAX_RATE, ReadBudget
from app.viewer.transport.client_messages import MAX_BYTES, ClientMessages, ForbiddenMessageError

BODY = "/w/robot/body"
DRAG = {
    "type": "SceneNodeDragMessage",
    "phase": "update",
    "name": BODY,
    "instance_index": None,
    "start_position": [0.0, 0.1, 1.0],
    "start_screen_pos": [0.5, 0.5],
    "end_position": [0.0, 0.4, 1],
    "end_screen_pos": [0.6, 0.5],
    "button": "left",
    "modifier": None,
    "owner": "",
}
NAN, INFINITY = math.nan, math.inf


class Panel:
    """Server with one control of each kind that the panel has."""

    def __init__(self, server: viser.ViserServer) -> None:
        gui = self.gui = server.gui
        self.server = server
        self.slider = gui.add_slider("slider", min=-0.3, max=0.3, step=0.01, initial_value=0.0)
        self.box = gui.add_checkbox("box", False)
        self.choice = gui.add_dropdown("choice", ["a", "b"])
        self.button = gui.add_button("button")
        self.locked = gui.add_checkbox("locked", False, disabled=True)
        self.upload = gui.add_upload_button("upload")
        with gui.add_form(None) as self.form:
            self.text = gui.add_text("text", "1")
        self.folder = gui.add_folder("folder")
        self.command = gui.add_command("command")

    def messages(self, is_operator: bool = True) -> ClientMessages:
        return ClientMessages(self.server, frozenset([BODY]), is_operator)

    def uuid(self, name: str) -> str:
        handle: Any = getattr(self, name)
        return handle._impl.uuid if hasattr(handle, "_impl") else getattr(handle, "_uuid", "")


@pytest.fixture(scope="module")
def panel() -> Iterator[Panel]:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield Panel(server)
    server.stop()


def only_key(mapping: dict[str, Any], value: Any) -> str:
    (key,) = [key for key, found in mapping.items() if found is value]
    return key


def set_value(uuid: str, **updates: Any) -> dict[str, Any]:
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates}


def honest(panel: Panel) -> list[dict[str, Any]]:
    """One message of each kind that a person's browser sends."""
    gui: Any = panel.gui
    form = only_key(gui._container_handle_from_uuid, panel.form)
    command = only_key(gui._command_handle_from_uuid, panel.command)
    values = {"slider": 0.2, "box": True, "choice": "b", "button": True, "text": "0.5"}
    return [
        CAMERA,
        *({**DRAG, "phase": phase} for phase in ("start", "update", "end")),
        *(set_value(panel.uuid(name), value=value) for name, value in values.items()),
        set_value(panel.uuid("slider"), value=0),
        {"type": "GuiFormDirtyMessage", "uuid": form},
        {"type": "GuiFormSubmitMessage", "uuid": form},
        {"type": "CommandTriggerMessage", "uuid": command},
    ]


def test_what_an_honest_browser_sends_goes_on_to_viser_as_it_is(panel):
    for message in honest(panel):
        messages = panel.messages()
        messages.add(msgspec.msgpack.encode(message))
        (sent,) = messages.take()
        assert msgspec.msgpack.decode(sent) == message
        assert type(_messages.Message.deserialize(sent)).__name__ == message["type"]


def refused(panel: Panel, message: Any) -> bool:
    """Whether a message is refused, and nothing of it goes on."""
    messages = panel.messages()
    data = message if isinstance(message, bytes) else msgspec.msgpack.encode(message)
    try:
        messages.add(data)
    except ForbiddenMessageError:
        return messages.take() == []
    return False


@pytest.mark.parametrize(
    "updates",
    [
        {"removed": True},
        {"update_cb": []},
        {"gui_api": None},
        {"sync_cb": None},
        {"value": 0.1, "disabled": True},
        {"label": "x"},
        {"value": NAN},
        {"value": "nan"},
        {"value": INFINITY},
        {"value": 0.4},
        {"value": -1e300},
        {"value": 10**30 / 1.0},
        {"value": True},
        {"value": None},
        {"value": [0.1]},
        {"value": {"a": 1}},
        {},
    ],
)
def test_a_forged_update_of_a_slider_is_refused(panel, updates):
    assert refused(panel, set_value(panel.uuid("slider"), **updates))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("box", 1),
        ("box", "True"),
        ("choice", "c"),
        ("choice", 0),
        ("choice", ""),
        ("button", False),
        ("button", 1),
        ("text", 1.0),
        ("text", "x" * 1000),
        ("text", "a\x00b"),
        ("text", "a\nb"),
        ("locked", True),
        ("upload", b"x"),
        ("upload", True),
    ],
)
def test_a_value_that_a_control_cannot_have_is_refused(panel, name, value):
    assert refused(panel, set_value(panel.uuid(name), value=value))


FORGED: list[Any] = [
    b"",
    b"\xc1",
    b"\x91" * 5000,
    b"\xdf\xff\xff\xff\xff",
    [],
    {},
    1,
    {"type": "GuiFormDirtyMessage", "uuid": "unknown"},
    {"type": "GuiFormDirtyMessage", "uuid": "u" * 1000},
    {"type": "GuiFormSubmitMessage", "uuid": ""},
    {"type": "CommandTriggerMessage", "uuid": "unknown"},
    {"type": "ShareUrlRequest"},
    {"type": "ShareUrlDisconnect"},
    {"type": "RunJavascriptMessage", "source": "alert(1)"},
    {"type": "GetRenderResponseMessage", "payload": b"x"},
    {"type": "FileTransferPart", "source_component_uuid": "x", "transfer_uuid": "y", "part_index": 0, "content": b"x"},
    {"type": "ScenePointerMessage", "event_type": "click", "screen_pos": []},
    {"type": "Message"},
    {"type": ["GuiUpdateMessage"]},
    {"type": None},
    set_value("unknown", value=True),
    {**CAMERA, "wxyz": [NAN, 0.0, 0.0, 0.0]},
    {**CAMERA, "wxyz": [0.0, 0.0, 0.0, 0.0]},
    {**CAMERA, "wxyz": [1.0, 0.0, 0.0]},
    {**CAMERA, "position": [1e300, 0.0, 0.0]},
    {**CAMERA, "position": ["1", 0.0, 0.0]},
    {**CAMERA, "fov": INFINITY},
    {**CAMERA, "excluded_self_client": 0},
    {**CAMERA, "pad": "x" * MAX_BYTES},
    {**DRAG, "name": "/w"},
    {**DRAG, "phase": "begin"},
    {**DRAG, "owner": "client_0"},
    {**DRAG, "instance_index": 1},
    {**DRAG, "end_position": [NAN, 0.0, 0.0]},
]


@pytest.mark.parametrize("message", FORGED, ids=range(len(FORGED)))
def test_a_forged_message_is_refused(panel, message):
    assert refused(panel, message)


def test_uploads_are_refused(panel):
    for name in ("upload", "slider"):
        start = {"type": "FileTransferStartUpload", "source_component_uuid": panel.uuid(name), "transfer_uuid": "t"}
        assert refused(panel, start | {"filename": "f", "mime_type": "", "part_count": 1, "size_bytes": 1})


LEAVES = st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text(max_size=8) | st.binary()
TREES = st.recursive(LEAVES, lambda inner: st.lists(inner) | st.dictionaries(st.text(max_size=8), inner), max_leaves=8)
QUICK = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=300)


@QUICK
@given(data=st.binary(max_size=200))
def test_bytes_of_any_kind_are_refused_without_another_error(panel, data):
    assert refused(panel, data)


@QUICK
@given(data=st.data())
def test_whatever_is_changed_in_a_message_viser_sees_only_values_that_a_person_can_give(panel, data):
    message = dict(data.draw(st.sampled_from(honest(panel))))
    place = message["updates"] = dict(message["updates"]) if "updates" in message else {}
    if not place:
        del message["updates"]
        place = message
    key = data.draw(st.sampled_from(sorted(place)) | st.sampled_from(["removed", "update_cb", "gui_api", "owner"]))
    place[key] = data.draw(TREES)
    messages = panel.messages()
    try:
        messages.add(msgspec.msgpack.encode(message))
    except ForbiddenMessageError:
        assert messages.take() == []
        return
    (sent,) = messages.take()
    seen: Any = _messages.Message.deserialize(sent)
    numbers = [number for field in vars(seen).values() for number in (field if isinstance(field, tuple) else (field,))]
    assert all(math.isfinite(number) for number in numbers if isinstance(number, float))
    if isinstance(seen, _messages.GuiUpdateMessage):
        assert list(seen.updates) == ["value"]
        handle: Any = panel.gui._gui_input_handle_from_uuid[seen.uuid]  # type: ignore[index]
        assert isinstance(seen.updates["value"], type(handle.value)) or isinstance(seen.updates["value"], float)
    if isinstance(seen, _messages.SceneNodeDragMessage):
        assert seen.name == BODY and seen.owner == ""


def test_of_many_messages_about_one_thing_the_latest_goes_on(panel):
    messages = panel.messages()
    for x in np.linspace(0.0, 1.0, 1000).tolist():
        messages.add(msgspec.msgpack.encode({**CAMERA, "position": [x, 0.0, 0.0]}))
        messages.add(msgspec.msgpack.encode(set_value(panel.uuid("slider"), value=0.3 * x)))
    camera, slider = (msgspec.msgpack.decode(sent) for sent in messages.take())
    assert camera["position"] == [1.0, 0.0, 0.0] and slider["updates"] == {"value": 0.3}
    assert messages.take() == []


def test_a_drag_keeps_its_beginning_and_its_end(panel):
    messages = panel.messages()
    for phase in ("start", "update", "update", "end"):
        messages.add(msgspec.msgpack.encode({**DRAG, "phase": phase}))
    phases = [msgspec.msgpack.decode(sent)["phase"] for sent in messages.take()]
    assert phases == ["start", "update", "end"]


def test_one_who_only_looks_moves_only_the_camera(panel):
    messages = panel.messages(is_operator=False)
    for message in honest(panel):
        messages.add(msgspec.msgpack.encode(message))
    assert [msgspec.msgpack.decode(sent)["type"] for sent in messages.take()] == ["ViewerCameraMessage"]


def test_a_browser_is_read_at_a_bounded_rate():
    budget, now = ReadBudget(), 1000.0
    for _ in range(10_000):
        now += budget.take(now)
    assert 10_000 - BURST <= MAX_RATE * (now - 1000.0) <= 10_000
    assert not any(budget.take(now + 10.0) for _ in range(BURST - 1))


def test_messages_to_controls_are_read_more_slowly(panel):
    kinds = {message["type"]: panel.messages().add(msgspec.msgpack.encode(message)) for message in honest(panel)}
    assert {kind for kind, is_control in kinds.items() if not is_control} == {CAMERA["type"], DRAG["type"]}
    budget, now = ReadBudget(), 1000.0
    for _ in range(1000):
        now += budget.take(now, COST_OF_CONTROLS)
    assert 1000 / (now - 1000.0) < 1.1 * MAX_RATE / COST_OF_CONTROLS


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with serving("--robot", "hrp2", "--scene", "light") as server:
        yield server
    lines = [line for line in server.output if "WARNING" in line]
    assert lines and all("a browser was disconnected from the scene for its message" in line for line in lines)


def browser(server: Server) -> SceneSocket:
    return SceneSocket(f"ws://{server.host}/viewer?client=test")


def close_code(browser: SceneSocket) -> int | None:
    """Code by which the server closes the connection, which is waited for."""
    with pytest.raises(ConnectionClosed) as closed:
        while True:
            browser.read()
    return None if closed.value.rcvd is None else closed.value.rcvd.code


def test_a_forged_message_ends_that_browser_and_no_other(server):
    with browser(server) as person:
        forward = controls(person.beginning())["forward [m/s]"]
        for forgery in (
            set_value(forward, removed=True),
            set_value(forward, **{"update_cb\nERROR forged": []}),
            set_value(forward, value="nan"),
            {"type": "GuiFormDirtyMessage", "uuid": "x"},
            b"\xc1",
            "text",
        ):
            with browser(server) as attacker:
                attacker.beginning()
                nb_lines = len(server.output)
                attacker.send(forgery)
                assert close_code(attacker) == 1008
                wait_for(lambda nb_lines=nb_lines: len(server.output) == nb_lines + 1)
        person.send(set_value(forward, value=0.1))
        with server.client() as api:
            wait_for(lambda: api.get("live").json()["driver"] == "sliders")
            assert api.get("live").json()["reference_vx"] == 0.1
        person.read()


def test_nothing_but_our_own_port_listens_and_the_socket_of_viser_is_for_this_user_only(server):
    process = psutil.Process(server.process.pid)
    everyone = [process, *process.children(recursive=True)]
    listening = [c.laddr.port for p in everyone for c in p.net_connections("tcp") if c.status == psutil.CONN_LISTEN]
    assert listening == [int(server.host.rpartition(":")[2])]
    (path,) = {c.laddr for c in process.net_connections("unix") if str(c.laddr).endswith("/socket")}

    assert stat.S_IMODE(os.stat(os.path.dirname(path)).st_mode) == 0o700
