"""Client that a viser server takes for a browser, for benchmarks."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import msgspec
import viser
from websockets.asyncio.client import ClientConnection, connect

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (-2.4, 1.7, 1.5),
    "fov": 0.7,
    "near": 0.1,
    "far": 100.0,
    "image_height": 800,
    "image_width": 1280,
    "look_at": (0.0, 0.0, 0.8),
    "up_direction": (0.0, 0.0, 1.0),
}


@asynccontextmanager
async def scene(address: str) -> AsyncIterator[ClientConnection]:
    """The stream of a viser server at a websocket's address, after it was sent where the camera is."""
    protocols: Any = [f"viser-v{viser.__version__}"]
    async with connect(address, subprotocols=protocols, compression=None, max_size=None) as socket:
        await socket.send(msgspec.msgpack.encode(CAMERA))
        yield socket
