"""Do the ticks of a served robot start in time while browsers stream and programs poll?

Starts a server, lets the robot walk, and opens clients, each in a process of its own: viser's stream by the
proxy, as the page opens it, and the live snapshot beside it. Another process polls by REST. The table has the
server's own measures of every tick and of the drawn frames between the first and the last second. Beside it runs
a loop of the same rate and precedence that does nothing: its delays are those of the machine.

    python benchmarks/deadlines.py --minutes 10 --clients 5
    python benchmarks/deadlines.py --minutes 1 --clients 1 5 20
"""

import asyncio
import json
import multiprocessing
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import httpx
import tyro
from empty_loop import EmptyLoop, empty_loop
from prometheus_client.parser import text_string_to_metric_families
from viser_client import scene
from websockets.asyncio.client import connect

WALK = Path(sys.executable).parent / "walk"
SETTLE = 5.0  # [s] for the clients to join before anything counts
PATIENCE = 60.0  # [s] for a response: the ticks are measured, not the requests
STREAM_RATE, POLL_RATE = 10.0, 20.0  # [Hz]
REFERENCE, RESTEER = {"vx": 0.2, "yaw_rate": 0.1}, 5.0  # [s]
LIMITS = {"5": 1e-4, "50": 0.0}  # share of the ticks that may start later than so many ms


@dataclass(frozen=True)
class Deadlines:
    """Choice of the measurements."""

    minutes: float = 10.0
    """Duration of each measurement [min]."""
    clients: tuple[int, ...] = (5,)
    """Numbers of browsers."""
    robot: str = "talos"
    json: Path | None = None
    """File for the measurements as JSON, too."""


@dataclass(frozen=True)
class Reading:
    """Values of `/metrics` and of the live snapshot at one moment."""

    at: float
    t: float
    ticks: int
    late: dict[str, int]
    late_ms_max: float
    misses: int
    tick_ms: float
    stages: dict[str, float]
    memory_mb: dict[str, float]
    cpu_s: dict[str, float]
    frames: int
    frames_s: float
    """Processor time of the thread that draws and sends the scene."""


def main(chosen: Deadlines) -> None:
    """Measure, and print a table for each number of clients."""
    found = []
    for nb_clients in chosen.clients:
        with server(chosen.robot) as url, crowd(url, nb_clients), empty_loop() as empty:
            found.append(measured(url, nb_clients, 60.0 * chosen.minutes, empty))
            print(table(found[-1]), flush=True)
    if chosen.json is not None:
        chosen.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


@contextmanager
def server(robot: str) -> Iterator[str]:
    """A server of its own on a free port."""
    with tempfile.TemporaryDirectory() as folder:
        command = [WALK, "serve", "--port", "0", "--robot", robot]
        environment = os.environ | {"WALK_DATA": folder}
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        assert process.stdout is not None
        try:
            yield process.stdout.readline().split()[-1]
        finally:
            process.terminate()
            process.wait()


@contextmanager
def crowd(url: str, nb_clients: int) -> Iterator[None]:
    """Browsers, and a program that polls."""
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=browse, args=(url,), daemon=True) for _ in range(nb_clients)]
    processes.append(context.Process(target=poll, args=(url,), daemon=True))
    for process in processes:
        process.start()
    try:
        yield
        assert all(process.is_alive() for process in processes), "a client has given up"
    finally:
        for process in processes:
            process.terminate()
            process.join()


def browse(url: str) -> None:
    """Read both streams, as a page does."""
    asyncio.run(_browse(url.replace("http://", "ws://")))


async def _browse(address: str) -> None:
    stream = f"{address}api/v1/live/stream?rate={STREAM_RATE:g}"
    async with (
        scene(f"{address}viewer") as drawn,
        connect(stream, compression=None) as live,
    ):
        await asyncio.gather(_drain(drawn), _drain(live))


async def _drain(socket: Any) -> None:
    async for _ in socket:
        pass


def poll(url: str) -> None:
    """Ask for the live snapshot at a steady rate, and steer now and then."""
    with httpx.Client(base_url=f"{url}api/v1/", timeout=PATIENCE) as api:
        due = steered = time.monotonic()
        while True:
            api.get("live").raise_for_status()
            if time.monotonic() > steered + RESTEER:
                api.put("live/reference", json=REFERENCE).raise_for_status()
                steered = time.monotonic()
            due += 1.0 / POLL_RATE
            time.sleep(max(due - time.monotonic(), 0.0))


def measured(url: str, nb_clients: int, seconds: float, empty: EmptyLoop) -> dict[str, Any]:
    """Measures of the ticks over a time [s]."""
    with httpx.Client(base_url=url, timeout=PATIENCE) as api:
        wait_for_clients(api, nb_clients)
        first, empty_first = reading(api), empty.late
        time.sleep(seconds)
        last, empty_last = reading(api), empty.late
        assert api.get("api/v1/health").json()["clients"] == nb_clients, "a client was lost"
    nb_ticks = last.ticks - first.ticks
    late = {edge: last.late[edge] - first.late[edge] for edge in last.late}
    return {
        "machine": f"{os.cpu_count()} x {platform.machine()}, load {os.getloadavg()[0]:.1f}",
        "clients": nb_clients,
        "seconds": last.at - first.at,
        "ticks": nb_ticks,
        "late": late,
        "empty_late": {edge: empty_last[edge] - empty_first[edge] for edge in empty_last},
        "late_ms_max": last.late_ms_max,
        "misses": last.misses - first.misses,
        "real_time_factor": (last.t - first.t) / (last.at - first.at),
        "holds": all(late[edge] <= share * nb_ticks for edge, share in LIMITS.items()),
        "frame_rate": (last.frames - first.frames) / (last.at - first.at),
        "frame_ms": 1e3 * (last.frames_s - first.frames_s) / (last.frames - first.frames),
        "cpu": {name: (last.cpu_s[name] - value) / (last.at - first.at) for name, value in first.cpu_s.items()},
        "first": asdict(first),
        "last": asdict(last),
    }


def wait_for_clients(api: httpx.Client, nb_clients: int) -> None:
    """Wait until all clients stream and the robot walks."""
    while api.get("api/v1/health").json()["clients"] < nb_clients:
        time.sleep(0.2)
    api.put("api/v1/live/reference", json=REFERENCE).raise_for_status()
    time.sleep(SETTLE)


def reading(api: httpx.Client) -> Reading:
    """The values at this moment."""
    families = {family.name: family.samples for family in text_string_to_metric_families(api.get("metrics").text)}
    frame = {sample.name: sample.value for sample in families["walk_frame_seconds"]}
    live = api.get("api/v1/live").json()
    timing = live["timing"]
    return Reading(
        at=time.monotonic(),
        t=live["t"],
        ticks=timing["ticks"],
        late=timing["late"],
        late_ms_max=timing["late_ms_max"],
        misses=timing["misses"],
        tick_ms=timing["tick_ms"],
        stages=timing["stages"],
        memory_mb={name: size / 1e6 for name, size in _by_process(families["walk_memory_bytes"]).items()},
        cpu_s=_by_process(families["walk_cpu_seconds"]),
        frames=round(frame["walk_frame_seconds_count"]),
        frames_s=frame["walk_frame_seconds_sum"],
    )


def _by_process(samples: Sequence[Any]) -> dict[str, float]:
    return {sample.labels["process"]: sample.value for sample in samples}


def table(found: dict[str, Any]) -> str:
    """The measures as text for a terminal."""
    first, last = found["first"], found["last"]
    lines = [
        f"{found['clients']} browsers, polling at {POLL_RATE:g} Hz, {found['seconds']:.0f} s on {found['machine']}:"
        f" {'holds' if found['holds'] else 'does not hold'}",
        f"  {found['ticks']} ticks, real-time factor {found['real_time_factor']:.4f}, {found['misses']} a period late",
        *(
            f"  started more than {edge:>2} ms late: {count}, of the empty loop {found['empty_late'][edge]}"
            for edge, count in found["late"].items()
        ),
        f"  latest start of all, since the server's own: {found['late_ms_max']:.2f} ms",
        f"  {found['frame_rate']:.1f} frames a second, each {found['frame_ms']:.2f} ms of the thread that draws;"
        " shares of a core: " + ", ".join(f"{name} {share:.3f}" for name, share in found["cpu"].items()),
        f"  {'[ms]':20} {'first':>8} {'last':>8}",
        f"  {'tick':20} {first['tick_ms']:8.3f} {last['tick_ms']:8.3f}",
        *(f"  {name:20} {first['stages'][name]:8.3f} {value:8.3f}" for name, value in last["stages"].items()),
        f"  {'[MB]':20} {'first':>8} {'last':>8}",
        *(f"  {name:20} {first['memory_mb'][name]:8.1f} {value:8.1f}" for name, value in last["memory_mb"].items()),
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main(tyro.cli(Deadlines))
