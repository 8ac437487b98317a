"""Messages of browsers to viser: what a browser may send, checked before viser sees it.

viser believes its clients: a message may set any attribute of any control, to any value, and one that cannot be read
ends in a traceback. So each message is decoded here, once, against the few types that our scene and panel need; its
handle has to exist, its value has to be one that the control can have, and what goes on to viser is encoded anew.

Of several messages about the same thing that have not gone on yet, the latest counts.
"""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Annotated, Any

import msgspec
import viser
from msgspec import Meta, Struct

from app.viewer.transport.viser_private import command_exists, container, input_handle

MAX_BYTES = 2048  # of a message; a camera has 250
MAX_TEXT = 256  # characters that a text field takes
UNIT_TOLERANCE = 1e-2  # of a quaternion's length
RANGE_TOLERANCE = 1e-6  # of a slider's limits
MAX_MAGNITUDE = 1e6  # of every number: metres, radians, pixels

NOTHING: Mapping[str, Callable[[str, bool], object]] = MappingProxyType({})

Number = Annotated[float, Meta(ge=-MAX_MAGNITUDE, le=MAX_MAGNITUDE)]  # neither NaN nor infinite
Name = Annotated[str, Meta(max_length=128)]
Pair = tuple[Number, Number]
Triple = tuple[Number, Number, Number]


class ForbiddenMessageError(ValueError):
    """A browser sent what no browser of ours sends."""


class _Camera(Struct, tag_field="type", tag="ViewerCameraMessage", forbid_unknown_fields=True):
    wxyz: tuple[Number, Number, Number, Number]
    position: Triple
    fov: Number
    near: Number
    far: Number
    image_height: Number
    image_width: Number
    look_at: Triple
    up_direction: Triple


class _Value(Struct, forbid_unknown_fields=True):
    value: bool | Number | Annotated[str, Meta(max_length=MAX_TEXT)]


class _ControlUpdate(Struct, tag_field="type", tag="GuiUpdateMessage", forbid_unknown_fields=True):
    uuid: Name
    updates: _Value


class _FormSubmit(Struct, tag_field="type", tag="GuiFormSubmitMessage", forbid_unknown_fields=True):
    uuid: Name


class _FormDirty(Struct, tag_field="type", tag="GuiFormDirtyMessage", forbid_unknown_fields=True):
    uuid: Name


class _Command(Struct, tag_field="type", tag="CommandTriggerMessage", forbid_unknown_fields=True):
    uuid: Name


class _Drag(Struct, tag_field="type", tag="SceneNodeDragMessage", forbid_unknown_fields=True):
    phase: Annotated[str, Meta(pattern="^(start|update|end)$")]
    name: Name
    instance_index: None
    start_position: Triple
    start_screen_pos: Pair
    end_position: Triple
    end_screen_pos: Pair
    button: Annotated[str, Meta(pattern="^(left|middle|right)$")]
    modifier: Annotated[str, Meta(max_length=32)] | None
    owner: Annotated[str, Meta(max_length=0)] = ""


_Message = _Camera | _ControlUpdate | _FormSubmit | _FormDirty | _Command | _Drag
_DECODER = msgspec.msgpack.Decoder(_Message)
_ENCODER = msgspec.msgpack.Encoder()


class ClientMessages:
    """Messages of one browser that may go on to viser, each checked when it comes.

    May be used from another thread than viser's: it only reads from viser's handles.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        draggable: frozenset[str],
        is_operator: bool = True,
        own_switches: Mapping[str, Callable[[str, bool], object]] = NOTHING,
    ) -> None:
        """Start without any.

        Args:
            server: its handles may be named.
            draggable: names of the nodes that may be dragged.
            is_operator: False drops everything but the camera, for one who only looks.
            own_switches: what is called, by the ids of switches that each browser sets for itself, with id and value;
                viser would set them for all.
        """
        self._server, self._draggable, self._is_operator = server, draggable, is_operator
        self._own_switches = own_switches
        self._pending: dict[tuple[str, ...], bytes] = {}

    def add(self, data: bytes) -> bool:
        """Check a message; it replaces an earlier one about the same thing that has not been taken yet.

        Returns:
            Whether it is about a control, and not about camera or drag.

        Raises:
            ForbiddenMessageError: if it is not allowed.
        """
        if len(data) > MAX_BYTES:
            raise ForbiddenMessageError(f"{len(data)} bytes, at most {MAX_BYTES} are allowed")
        try:
            message = _DECODER.decode(data)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            raise ForbiddenMessageError(str(error)) from error
        key = self._checked(message)
        if isinstance(message, _ControlUpdate) and message.uuid in self._own_switches:
            self._own_switches[message.uuid](message.uuid, message.updates.value is True)
        elif self._is_operator or isinstance(message, _Camera):
            self._pending.pop(key, None)  # so that the order is that of the latest ones
            self._pending[key] = _ENCODER.encode(message)
        return not isinstance(message, _Camera | _Drag)

    def take(self) -> list[bytes]:
        """The messages that have come since the last call, ready for viser."""
        taken, self._pending = list(self._pending.values()), {}
        return taken

    def _checked(self, message: _Message) -> tuple[str, ...]:
        """The control or camera that a message changes, if it exists and may have that value."""
        kind = type(message).__name__
        match message:
            case _Camera():
                _require(abs(math.hypot(*message.wxyz) - 1.0) < UNIT_TOLERANCE, "the camera's wxyz is no rotation")
                return (kind,)
            case _ControlUpdate():
                handle = input_handle(self._server, message.uuid)
                _require(handle is not None and _can_be(handle, message.updates.value), "no such value of a control")
                return kind, message.uuid
            case _FormSubmit() | _FormDirty():
                is_form = isinstance(container(self._server, message.uuid), viser.GuiFormHandle)
                _require(is_form, "no such form")
                return kind, message.uuid
            case _Command():
                _require(command_exists(self._server, message.uuid), "no such command")
                return kind, message.uuid
            case _Drag():
                _require(message.name in self._draggable, "no such node to drag")
                return kind, message.name, message.phase


def _require(condition: bool, otherwise: str) -> None:
    if not condition:
        raise ForbiddenMessageError(otherwise)


def _can_be(handle: Any, value: bool | float | str) -> bool:
    """Whether a person can give a control this value."""
    if handle.disabled or not handle.visible:
        return False
    match handle:
        case viser.GuiCheckboxHandle():
            return isinstance(value, bool)
        case viser.GuiButtonHandle():
            return value is True
        case viser.GuiSliderHandle():
            return isinstance(value, float) and handle.min - RANGE_TOLERANCE <= value <= handle.max + RANGE_TOLERANCE
        case viser.GuiDropdownHandle():
            return value in handle.options
        case viser.GuiTextHandle():
            return isinstance(value, str) and value.isprintable()
        case _:
            return False
