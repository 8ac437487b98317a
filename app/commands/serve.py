"""Listening: one socket, one line that says where, and a quick end."""

import socket
import sys

import uvicorn

from app.main import create_app
from app.settings import Settings

SEND_BUFFER = 32 * 1024  # bytes the system holds for a slow reader: what is in there cannot be overtaken by newer
MAX_MESSAGE = 64 * 1024  # bytes of a websocket message
SWITCH_INTERVAL = 0.001  # [s] after which Python takes the processor from a long answer for a frame that is due
GRACE = 1  # [s] for open connections when the server stops


def serve(settings: Settings) -> None:
    """Serve until interrupted; exits with 1 where the address cannot be had."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    listening = _listen(settings)
    config = uvicorn.Config(
        create_app(settings),
        log_level="warning",
        timeout_graceful_shutdown=GRACE,
        ws="websockets-sansio",
        ws_max_size=MAX_MESSAGE,
        ws_per_message_deflate=False,
    )
    print(f"walk: open {_address(settings.host, listening)}", flush=True)
    try:
        uvicorn.Server(config).run(sockets=[listening])
    except KeyboardInterrupt:
        return  # uvicorn has shut down and passes the signal on


def _listen(settings: Settings) -> socket.socket:
    listening = socket.socket(socket.AF_INET6 if ":" in settings.host else socket.AF_INET)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
    try:
        listening.bind((settings.host, settings.port))
    except OSError as error:
        sys.exit(f"walk: cannot listen on {settings.host} port {settings.port}: {error.strerror or error}")
    listening.listen()
    return listening


def _address(host: str, listening: socket.socket) -> str:
    port = listening.getsockname()[1]
    host = {"0.0.0.0": "localhost", "::": "localhost"}.get(host, host)
    return f"http://[{host}]:{port}/" if ":" in host else f"http://{host}:{port}/"
