"""viser behind our port, and browsers that go as soon as they came."""

import socket

import viser
from conftest import serving

VISITS = 4
UPGRADE = (
    "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
    "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
    "Sec-WebSocket-Protocol: viser-v{version}\r\n\r\n"
)


def test_browsers_that_leave_before_the_scene_opens_do_not_hold_up_the_end():
    """viser's response to a close comes after its first messages, and nobody takes those."""
    with serving("--robot", "hrp2", "--scene", "light") as server:
        port = int(server.host.rpartition(":")[2])
        for path in VISITS * ["/viewer", "/viewer/light"]:
            with socket.create_connection(("127.0.0.1", port)) as browser:
                browser.sendall(UPGRADE.format(path=path, host=server.host, version=viser.__version__).encode())
