"""Client that a viser server takes for a browser, for benchmarks."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import msgspec
import viser
from websockets.asyncio.client import ClientConnection, connect, unix_connect

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
    """The stream of a viser server, after it was sent where the camera is.

    Args:
        address: of a websocket, or the path of a Unix socket.
    """
    protocols: Any = [f"viser-v{viser.__version__}"]
    options: Any = {"subprotocols": protocols, "compression": None, "max_size": None}
    opening = connect(address, **options) if "://" in address else unix_connect(address, **options)
    async with opening as socket:
        await socket.send(msgspec.msgpack.encode(CAMERA))
        yield socket
