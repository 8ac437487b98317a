"""A served robot among hostile clients for a time: does anything grow, end, or keep the person who drives waiting?

Starts a server. One process drives as a person does, by the page's sockets. Another is all hostile clients at once:
floods of requests, readers that do not read, browsers that come and go, random pushes, bad messages on every socket.
Printed is a Markdown table with a row for each part of the time: memory, descriptors, threads and late ticks.

    python benchmarks/soak_server.py --minutes 60
"""

import asyncio
import itertools
import json
import math
import multiprocessing
import os
import platform
import random
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import httpx
import psutil
import tyro
from viser_client import scene
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

WALK = Path(sys.executable).parent / "walk"
PATIENCE = 60.0  # [s] for a response
FALLEN = 2  # status of a snapshot
SHORT = {"robot": "hrp2", "duration": 2.0, "parameters": {"control_period": 0.1}}
BAD_BODIES: tuple[Any, ...] = (
    *({}, [], {"solver": []}, {"alpha": "x" * 150_000}, {"vx": None}, {"impulse": [1e9, 0]}, {"ticks": -1}),
    *({"duration": 1e308}, {"events": [[]] * 500}, {"a": 10**300}),
)
ROUTES = (
    *(("GET", "health"), ("GET", "runs"), ("GET", "live"), ("GET", "scenarios"), ("PATCH", "live/parameters")),
    *(("PUT", "live/reference"), ("POST", "live/push"), ("POST", "runs"), ("POST", "live/save"), ("GET", "runs/none")),
)
BAD_MESSAGES = ("", "{", "x" * 5000, '{"reference": {"vx": "fast"}}', b"\x00\xff" * 50, b"\x81\xa4type\xa1x")


@dataclass(frozen=True)
class SoakServer:
    """The options of the command line."""

    minutes: float = 60.0
    rows: int = 6
    """Rows of the table."""
    robot: str = "talos"
    push: float = 5.0
    """Largest random impulse [N s]."""


@dataclass(frozen=True)
class Sample:
    """Measures of the server at one moment."""

    memory_mb: float
    control_memory_mb: float
    descriptors: int
    threads: int
    ticks: float
    """Control periods since the server started."""
    late: dict[str, int]
    real_time_factor: float
    status: str


@dataclass(frozen=True)
class Seen:
    """Observations of the person in a part of the time."""

    worst_gap: float
    """Longest time between two snapshots [s]."""
    worst_response: float
    """Longest time until a request to push was responded to [s]."""
    falls: int
    cuts: int
    """Connections that ended."""


def main(soak: SoakServer) -> None:
    """Serve, attack, measure, and print the table."""
    with served(soak.robot) as (url, process), hostile(url, soak.push), person(url) as seen:
        print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, {soak.robot}\n")
        print(
            "| min | server [MB] | control [MB] | descriptors | threads | ticks late > 5 ms | > 50 ms | real time |",
            end="",
        )
        print(" longest gap of snapshots [s] | slowest push [s] | falls | cuts | health |\n|" + "---|" * 13, flush=True)
        before = sample(url, process)
        for row in range(soak.rows):
            time.sleep(60.0 * soak.minutes / soak.rows)
            now = sample(url, process)
            seen.send(None)
            told = seen.recv() if seen.poll(PATIENCE) else Seen(math.inf, math.inf, 0, 0)
            print(line((row + 1) * soak.minutes / soak.rows, before, now, told), flush=True)
            before = now
        print(f"\nwarnings of the server: {nb_warnings(process)}")


def line(minute: float, before: Sample, now: Sample, seen: Seen) -> str:
    """A row of the table; ticks are those of its part of the time."""
    ticks = max(1, now.ticks - before.ticks)
    late = [
        f"{max(0, now.late[ms] - before.late[ms])} ({(now.late[ms] - before.late[ms]) / ticks:.2%})"
        for ms in ("5", "50")
    ]
    cells = [
        *(f"{minute:g}", f"{now.memory_mb:.0f}", f"{now.control_memory_mb:.0f}", now.descriptors, now.threads, *late),
        *(f"{now.real_time_factor:.3f}", f"{seen.worst_gap:.2f}", f"{seen.worst_response:.2f}", seen.falls, seen.cuts),
        now.status,
    ]
    return f"| {' | '.join(map(str, cells))} |"


@contextmanager
def served(robot: str) -> Iterator[tuple[str, psutil.Process]]:
    """A server of its own on a free port, with its log in a file."""
    with tempfile.TemporaryDirectory() as folder, (Path(folder) / "log").open("w") as log:
        environment = os.environ | {"WALK_DATA": f"{folder}/data"}
        command = [WALK, "serve", "--port", "0", "--robot", robot]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True, env=environment)
        assert process.stdout is not None
        try:
            yield process.stdout.readline().split()[-1], psutil.Process(process.pid)
        finally:
            process.terminate()
            process.wait()


def nb_warnings(process: psutil.Process) -> str:
    """Kinds of lines in the server's log, the most frequent first."""
    text = Path(os.readlink(f"/proc/{process.pid}/fd/2")).read_text(errors="replace")
    said = (line for line in text.splitlines() if not line.startswith(" "))  # without the frames of tracebacks
    kinds = Counter(" ".join(line.split()[:8]) for line in said)
    return "; ".join(f"{count} x {kind}" for kind, count in kinds.most_common(5)) or "none"


def sample(url: str, process: psutil.Process) -> Sample:
    """Measures of the server and of its control process."""
    health = httpx.get(f"{url}api/v1/health", timeout=PATIENCE).json()
    return Sample(
        memory_mb=process.memory_info().rss / 1e6,
        control_memory_mb=memory_mb(health["control_process"]),
        descriptors=process.num_fds(),
        threads=process.num_threads(),
        ticks=health["uptime"] * health["tick_rate"],
        late=health["late"],
        real_time_factor=health["real_time_factor"],
        status=health["status"],
    )


def memory_mb(process: int) -> float:
    """Resident memory of a process; none where it has ended."""
    with suppress(psutil.NoSuchProcess):
        return psutil.Process(process).memory_info().rss / 1e6
    return 0.0


@contextmanager
def person(url: str) -> Iterator[Connection]:
    """A person who drives in a process; responds to each message with what was `Seen` since the last."""
    ours, theirs = multiprocessing.Pipe()
    with running(drive, url, theirs):
        yield ours


@contextmanager
def hostile(url: str, push: float) -> Iterator[None]:
    """All hostile clients, in a process."""
    with running(attack, url, push):
        yield


@contextmanager
def running(target: Callable[..., None], *arguments: object) -> Iterator[None]:
    """A process for the time of the context."""
    context = multiprocessing.get_context("spawn")
    is_ready = context.Event()
    process = context.Process(target=_begin, args=(is_ready, target, *arguments), daemon=True)
    process.start()
    is_ready.wait()
    try:
        yield
        if not process.is_alive():
            print(f"\nthe clients of {target.__name__}() ended before their time")
    finally:
        process.kill()
        process.join()


def _begin(is_ready: Any, target: Callable[..., None], *arguments: object) -> None:
    is_ready.set()
    target(*arguments)


def drive(url: str, report: Connection) -> None:
    """Drive along bends as a person does, look at what comes of it, and get up after a fall."""
    asyncio.run(_drive(url, report))


async def _drive(url: str, report: Connection) -> None:
    worst = {"gap": 0.0, "response": 0.0, "falls": 0, "cuts": 0}
    asyncio.get_running_loop().add_reader(report.fileno(), _tell, report, worst)
    while True:
        try:
            await _visit(url, worst)
        except (OSError, httpx.HTTPError, WebSocketException, TimeoutError):
            worst["cuts"] += 1
            await asyncio.sleep(1.0)


def _tell(report: Connection, worst: dict[str, Any]) -> None:
    report.recv()
    report.send(Seen(worst["gap"], worst["response"], worst["falls"], worst["cuts"]))
    worst.update(gap=0.0, response=0.0, falls=0, cuts=0)


async def _visit(url: str, worst: dict[str, Any]) -> None:
    sockets = url.replace("http", "ws") + "api/v1/live/"
    async with (
        httpx.AsyncClient(base_url=f"{url}api/v1/live/", timeout=PATIENCE) as api,
        connect(f"{sockets}stream?rate=30", max_size=None) as stream,
        connect(f"{sockets}teleop?client=person") as teleop,
    ):
        at = time.monotonic()
        for beat in itertools.count():
            status = json.loads(await asyncio.wait_for(stream.recv(), PATIENCE))["status"]
            now = time.monotonic()
            worst["gap"], at = max(worst["gap"], now - at), now
            if beat % 2 == 0:
                reference = {"vx": 0.2 if beat // 300 % 3 else 0.0, "yaw_rate": 0.2 * (-1) ** (beat // 600)}
                await teleop.send(json.dumps({"reference": reference, "engagement": 1}))
            if status == FALLEN:
                worst["falls"] += 1
                await api.post("reset")
                await asyncio.sleep(1.0)
                at = time.monotonic()
            elif beat % 150 == 0:
                begun = time.monotonic()
                await api.post("push", json={"impulse": [0.5, 0.5]})
                worst["response"], at = max(worst["response"], time.monotonic() - begun), time.monotonic()


def attack(url: str, push: float) -> None:
    """Be all hostile clients at once, each again and again."""
    asyncio.run(_attack(url, push))


async def _attack(url: str, push: float) -> None:
    clients = [
        *(_flood(url) for _ in range(4)),
        *(_not_reading(url) for _ in range(10)),
        *(_coming_and_going(url) for _ in range(4)),
        *(_talking_nonsense(url) for _ in range(3)),
        *(_pushing(url, push), _running_scenarios(url)),
    ]
    await asyncio.gather(*clients)


async def _again(what: Callable[[], Awaitable[None]], pause: float) -> None:
    """Do it for ever, whatever the server makes of it."""
    while True:
        with suppress(OSError, httpx.HTTPError, WebSocketException, TimeoutError):
            await what()
        await asyncio.sleep(random.uniform(0.5, 1.5) * pause)


async def _flood(url: str) -> None:
    async with httpx.AsyncClient(base_url=f"{url}api/v1/", timeout=PATIENCE) as api:

        async def request() -> None:
            method, path = random.choice(ROUTES)
            body = {} if method == "GET" else {"json": random.choice(BAD_BODIES)}
            response = await api.request(method, path, **body)
            assert response.status_code != 500, f"{method} {path} {body}"[:300]

        await _again(request, 0.02)


async def _not_reading(url: str) -> None:
    """A stream of snapshots whose reader reads nothing for a while."""
    address = url.replace("http", "ws") + "api/v1/live/stream?rate=60"

    async def hold() -> None:
        with socket.socket() as small:
            small.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            host, _, port = url.removeprefix("http://").strip("/").partition(":")
            small.setblocking(False)
            await asyncio.get_running_loop().sock_connect(small, (host, int(port)))
            async with connect(address, sock=small, max_queue=1, close_timeout=1):
                await asyncio.sleep(random.uniform(5.0, 60.0))

    await _again(hold, 1.0)


async def _coming_and_going(url: str) -> None:
    """A browser with the page's files and sockets, which is cut after a moment."""
    sockets = url.replace("http", "ws")

    async def visit() -> None:
        async with httpx.AsyncClient(timeout=PATIENCE) as api:
            await api.get(url)
        async with (
            connect(f"{sockets}api/v1/live/stream?rate=30", max_size=None) as stream,
            scene(f"{sockets}viewer/") as view,
        ):
            for _ in range(random.randrange(30)):
                await asyncio.wait_for(stream.recv(), PATIENCE)
                await asyncio.wait_for(view.recv(), PATIENCE)
            stream.transport.abort()
            view.transport.abort()

    await _again(visit, 1.0)


async def _talking_nonsense(url: str) -> None:
    sockets = url.replace("http", "ws")

    async def talk() -> None:
        async with connect(f"{sockets}api/v1/live/teleop", close_timeout=1) as teleop:
            for _ in range(20):
                await teleop.send(random.choice(BAD_MESSAGES))
        async with scene(f"{sockets}viewer/") as view:
            await view.send(random.choice(BAD_MESSAGES))
            await asyncio.sleep(0.2)
        host, _, port = url.removeprefix("http://").strip("/").partition(":")
        _, writer = await asyncio.open_connection(host, int(port))
        writer.write(random.randbytes(100) + b"\r\n\r\n")
        await writer.drain()
        writer.close()

    await _again(talk, 0.5)


async def _pushing(url: str, push: float) -> None:
    async with httpx.AsyncClient(base_url=f"{url}api/v1/live/", timeout=PATIENCE) as api:

        async def shove() -> None:
            await api.post("push", json={"impulse": [random.uniform(-push, push), random.uniform(-push, push)]})

        await _again(shove, 5.0)


async def _running_scenarios(url: str) -> None:
    async with httpx.AsyncClient(base_url=f"{url}api/v1/", timeout=PATIENCE) as api:

        async def submit() -> None:
            await api.post("runs", json=SHORT)
            runs = (await api.get("runs")).json()
            for run in runs[20:]:
                await api.delete(f"runs/{run['id']}")

        await _again(submit, 2.0)


if __name__ == "__main__":
    main(tyro.cli(SoakServer))
