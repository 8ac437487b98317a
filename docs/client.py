"""Follow the robot that walks on the page: python docs/client.py [http://localhost:8000] [seconds].

Needs `pip install websockets msgpack`. A server with a token takes it from the environment: WALK_TOKEN.
"""

import os
import sys
import time

import msgpack
from websockets.sync.client import connect

server = sys.argv[1].rstrip("/") if len(sys.argv) > 1 else "http://localhost:8000"
end = time.monotonic() + (float(sys.argv[2]) if len(sys.argv) > 2 else 10.0)
token = os.environ.get("WALK_TOKEN")
headers = {"Authorization": f"Bearer {token}"} if token else {}
address = f"ws{server.removeprefix('http')}/api/v1/live/stream?rate=10&format=msgpack"

with connect(address, additional_headers=headers) as stream:
    while time.monotonic() < end:
        s = msgpack.unpackb(stream.recv())  # the latest snapshot: nothing is queued for a slow reader
        print(
            f"t {s['t']:7.2f} s  CoM ({s['com_x']:.3f}, {s['com_y']:.3f}) m  CoP ({s['cop_x']:.3f}, {s['cop_y']:.3f}) m"
        )
