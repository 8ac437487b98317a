"""Cost of a drawn frame to the server: its own work by part, bytes to each client, and the wait of a new client.

A recorded walk takes the place of the control loop, so that all that this process does is draw and send. The
clients are processes of their own that read viser's stream as a browser does.

    python benchmarks/viewer.py --clients 1 5 --seconds 20
    python benchmarks/viewer.py --public    # the scene by viser's handles, to justify `viser_private`
"""

import argparse
import asyncio
import json
import multiprocessing
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import zstandard
from viser_client import scene

from app.live.live_state import LiveState
from app.live.tick_scheduler import TickScheduler
from app.viewer import Viewer
from app.viewer.replay_page import assign_to_handles
from app.viewer.transport.scene_updates import SceneUpdates
from app.viewer.transport.viser_private import nb_message_ids
from app.viewer.viewer import PERIOD
from walkcore import Command, Parameters, Reference, Simulation, load_robot

WALK_SECONDS = 8.0
HEADER = 16  # bytes before the compressed part of a message of viser
SETTLE = 1.0  # [s] after the clients have come
JOIN_SECONDS = 4.0  # that the one more is watched, and the others meanwhile


class Replay:
    """Stand-in for the runner: a walk that was recorded before, over and over."""

    active_driver = ("rest", "")
    """Active driver, and the browser that it belongs to."""

    def __init__(self) -> None:
        self.robot, self.parameters = load_robot("talos"), Parameters(dynamic_filter=True)
        simulation = Simulation(self.robot, self.parameters)
        reference = Reference(vx=0.25, yaw_rate=0.1)
        nb_ticks = round(WALK_SECONDS / self.parameters.control_period)
        self._snapshots = [simulation.step(Command(reference)) for _ in range(nb_ticks)]
        self._first = LiveState(self._snapshots[0], TickScheduler(self.parameters.control_period).timing, True, "rest")

    @property
    def latest(self) -> LiveState:
        """The snapshot of this moment."""
        tick = int(time.monotonic() / self.parameters.control_period)
        return replace(self._first, snapshot=self._snapshots[tick % len(self._snapshots)])

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *_, **__: None  # nobody drives


def read_as_browser(address: str, seconds: float, results: "multiprocessing.Queue[dict[str, float]]") -> None:
    """Connect, read until one more has joined, and tell how that went."""
    results.put(asyncio.run(_read(address, seconds + JOIN_SECONDS, of_which_alone=seconds)))


async def _read(address: str, seconds: float, of_which_alone: float) -> dict[str, float]:
    started = time.perf_counter()
    joined = joined_bytes = nb_bytes = nb_frames = 0.0
    last, longest, longest_at_join = None, 0.0, 0.0
    async with scene(address) as socket:
        while (now := time.perf_counter() - started) < seconds:
            try:
                message = await asyncio.wait_for(socket.recv(decode=False), 0.5)
            except TimeoutError:
                continue
            if not joined:
                joined_bytes += len(message)
                if any(part["type"] == "ReplayDoneMessage" for part in _parts(message)):
                    joined = time.perf_counter() - started
                continue
            nb_bytes, nb_frames = nb_bytes + len(message), nb_frames + 1
            gap, last = now - (last or now), now
            if now < of_which_alone:
                longest = max(longest, gap)
            else:
                longest_at_join = max(longest_at_join, gap)
    return {
        "join_ms": 1e3 * joined,
        "join_kB": joined_bytes / 1e3,
        "kB_per_s": nb_bytes / 1e3 / (seconds - joined),
        "messages_per_s": nb_frames / (seconds - joined),
        "longest_gap_ms": 1e3 * longest,
        "longest_gap_at_join_ms": 1e3 * longest_at_join,
    }


def _parts(message: bytes) -> Iterator[dict[str, Any]]:
    size = int.from_bytes(message[8:HEADER], "little")
    content = zstandard.ZstdDecompressor().decompress(message[HEADER : HEADER + size])
    yield from msgspec.msgpack.decode(content)["messages"]


def time_parts(viewer: Viewer) -> dict[str, float]:
    """Let the drawings of the scene and the sending count the processor time that each takes [s]."""
    spent: dict[str, float] = defaultdict(float)

    def timed(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def count(*args: Any) -> Any:
            started = time.thread_time()
            try:
                return call(*args)
            finally:
                spent[name] += time.thread_time() - started

        return count

    for name, drawing in viewer.scene.drawings.items():
        drawing.update = timed(name, drawing.update)
    viewer.broadcaster.send = timed("sending", viewer.broadcaster.send)
    viewer.scene.draw = timed("all drawing", viewer.scene.draw)
    return spent


def send_by_handles(viewer: Viewer) -> None:
    """Send the scene by viser's public handles instead; the panel's plots and table are left out."""

    def send(updates: SceneUpdates) -> None:
        with viewer.server.atomic():
            assign_to_handles(viewer.server, updates)
        viewer.server.flush()

    viewer.broadcaster.send = send


def measure(viewer: Viewer, spent: dict[str, float], nb_clients: int, seconds: float) -> dict[str, Any]:
    """Stream to some clients for some time, then let one more join."""
    context = multiprocessing.get_context("spawn")
    results: multiprocessing.Queue[dict[str, float]] = context.Queue()
    arguments = (str(viewer.socket), SETTLE + seconds, results)
    clients = [context.Process(target=read_as_browser, args=arguments) for _ in range(nb_clients)]
    for client in clients:
        client.start()
    while len(viewer.server.get_clients()) < nb_clients:
        time.sleep(0.05)
    time.sleep(SETTLE)
    spent.clear()
    ids, cpu, wall = nb_message_ids(viewer.server), time.process_time(), time.monotonic()
    time.sleep(seconds)
    late = context.Process(target=read_as_browser, args=(str(viewer.socket), 0.0, results))
    cpu, elapsed = time.process_time() - cpu, time.monotonic() - wall
    frames = elapsed / PERIOD
    parts = {name: 1e3 * value / frames for name, value in spent.items()}
    late.start()
    outcomes = [results.get() for _ in range(nb_clients + 1)]
    for client in (*clients, late):
        client.join()
    return {
        "clients": nb_clients,
        "ms_per_frame": 1e3 * cpu / frames,
        "parts_ms": parts,
        "ids_per_s": (nb_message_ids(viewer.server) - ids) / (time.monotonic() - wall),
        **{key: float(np.max([outcome[key] for outcome in outcomes])) for key in outcomes[0]},
    }


def main() -> None:
    """Measure for each number of clients."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clients", type=int, nargs="+", default=[1, 5])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--public", action="store_true", help="send the scene by viser's handles")
    arguments = parser.parse_args()
    viewer = Viewer(Replay())  # pyright: ignore[reportArgumentType]
    if arguments.public:
        send_by_handles(viewer)
    spent = time_parts(viewer)
    viewer.start()
    for nb_clients in arguments.clients:
        print(json.dumps(measure(viewer, spent, nb_clients, arguments.seconds), indent=1), flush=True)
    viewer.stop()


if __name__ == "__main__":
    main()
