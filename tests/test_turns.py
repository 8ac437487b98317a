"""Turns of requests: however many come at once, whatever else is due has the event loop between two of them."""

import asyncio
import os
import time
from typing import Any

import pytest

from app.http import turns
from app.http.turns import TurnMiddleware
from app.main import NICENESS, request_priority

URGENT = "/urgent"


def request(path: str, address: str = "10.0.0.1", kind: str = "http") -> dict[str, Any]:
    return {"type": kind, "path": path, "client": (address, 1)}


def begun(requests: list[dict[str, Any]], work: float = 0.0) -> list[tuple[str, int, float]]:
    """Path, pass of the event loop and time [s] at which each of some simultaneous requests began.

    Args:
        requests: scopes, in the order in which they come.
        work: time that each holds up the loop [s].
    """
    found, nb_passes = list[tuple[str, int, float]](), 0

    async def application(scope: Any, receive: Any, send: Any) -> None:
        found.append((scope["path"], nb_passes, time.monotonic()))
        time.sleep(work)

    async def serve() -> None:
        nonlocal nb_passes
        guarded = TurnMiddleware(application, frozenset({URGENT}))
        all_done = asyncio.gather(*(guarded(scope, None, None) for scope in requests))  # type: ignore[arg-type]
        while not all_done.done():
            await asyncio.sleep(0)
            nb_passes += 1

    asyncio.run(serve())
    return found


@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_a_stream_has_the_event_loop_between_any_two_requests(kind):
    passes = [nb for _, nb, _ in begun([request(str(i), kind=kind) for i in range(50)])]
    assert len(passes) == 50
    assert all(later > earlier for earlier, later in zip(passes, passes[1:], strict=False))


def test_after_a_request_that_took_long_the_next_one_waits_as_long(monkeypatch):
    monkeypatch.setattr(turns, "SHORT_PASS", 0.0)
    times = [at for _, _, at in begun([request(str(i)) for i in range(5)], work=0.01)]
    assert all(later - earlier >= 0.02 - 2e-3 for earlier, later in zip(times, times[1:], strict=False))


def test_addresses_take_turns_and_within_one_the_first_goes_first():
    flood = [request(f"flood {i}") for i in range(20)]
    person = [request(f"person {i}", "10.0.0.2") for i in range(3)]
    paths = [path for path, _, _ in begun(flood + person)]
    assert paths[:8] == [
        *("flood 0", "flood 1", "person 0", "flood 2", "person 1", "flood 3", "person 2"),
        "flood 4",
    ]


def test_an_urgent_request_does_not_wait():
    paths = [path for path, _, _ in begun([*(request(str(i)) for i in range(20)), request(URGENT)])]
    assert paths.index(URGENT) == 1


@pytest.mark.parametrize(("own", "is_permitted", "expected"), [(0, True, [NICENESS]), (0, False, []), (10, True, [])])
def test_the_server_goes_before_other_processes_unless_forbidden_or_told_otherwise(
    monkeypatch, own, is_permitted, expected
):
    taken = list[int]()

    def set_priority(_which: int, _who: int, niceness: int) -> None:
        if not is_permitted:
            raise PermissionError
        taken.append(niceness)

    monkeypatch.setattr(os, "getpriority", lambda *_: own)
    monkeypatch.setattr(os, "setpriority", set_priority)
    request_priority()
    assert taken == expected and NICENESS < 0
