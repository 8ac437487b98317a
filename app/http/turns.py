"""Shares of the event loop: turns of requests, and the rate at which a socket is read.

A flood of either leaves the loop to those who look and drive.

All connections share one thread. A loop that has many requests at hand begins all of them in one pass, and what else
is due, a picture of the robot or a message of the stick, waits for the last. So one request begins in a pass, and after
a pass that took long the next one waits as long: the streams go on, and a thread that sleeps now and then is not put
behind the other processes of a busy machine. Addresses take turns, and within one whoever came first. The messages of
a socket are read at a bounded rate; a sender of more has to wait.
"""

import asyncio
from collections import OrderedDict, deque

from starlette.types import ASGIApp, Receive, Scope, Send

from app.http.token import address_of

SHORT_PASS = 0.004  # [s] of the loop, after which the next request need not wait
MAX_PAUSE = 0.1  # [s] between two requests
MAX_RATE = 120.0  # messages that are read of one browser a second; a person's camera sends 50, a slider 20
BURST = 30  # messages that are read at once


class Turns:
    """Turns to begin with a request. Belongs to the event loop."""

    def __init__(self) -> None:
        """Start with nobody waiting."""
        self._waiting = OrderedDict[str, deque[asyncio.Future[None]]]()
        self._is_taken = False

    async def take(self, address: str) -> None:
        """Wait for a turn.

        Args:
            address: of the client.
        """
        if not self._is_taken:
            self._is_taken = True
            self._pass_on()
            return
        turn = asyncio.get_running_loop().create_future()
        self._waiting.setdefault(address, deque()).append(turn)
        await turn

    def _pass_on(self) -> None:
        """Give the next turn once this one's request has begun and whatever else is due has had the loop."""
        loop = asyncio.get_running_loop()
        loop.call_soon(self._pause, loop.time())

    def _pause(self, given_at: float) -> None:
        loop = asyncio.get_running_loop()
        spent = loop.time() - given_at
        loop.call_later(min(spent, MAX_PAUSE) if spent > SHORT_PASS else 0.0, self._give)

    def _give(self) -> None:
        while self._waiting:
            address, turns = self._waiting.popitem(last=False)
            turn = turns.popleft()
            if turns:
                self._waiting[address] = turns  # as the last one
            if not turn.done():  # else the server stops
                turn.set_result(None)
                self._pass_on()
                return
        self._is_taken = False


class TurnMiddleware:
    """Has every request and every beginning of a websocket wait for its turn."""

    def __init__(self, app: ASGIApp, urgent: frozenset[str]) -> None:
        """Guard `app`.

        Args:
            app: that all take.
            urgent: paths of requests that do not wait; each has to be cheap.
        """
        self._app, self._urgent = app, urgent
        self._turns = Turns()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on in turn."""
        if scope["type"] in ("http", "websocket") and scope["path"] not in self._urgent:
            await self._turns.take(address_of(scope))
        await self._app(scope, receive, send)


class ReadBudget:
    """Rate at which the messages of one socket are read."""

    def __init__(self, rate: float = MAX_RATE, burst: int = BURST) -> None:
        """Start with all of the burst.

        Args:
            rate: messages a second.
            burst: messages that are read at once.
        """
        self._rate, self._burst = rate, burst
        self._due = 0.0

    def take(self, now: float, cost: int = 1) -> float:
        """Count a message, and return how long to wait before the next is read [s].

        Args:
            now: time of any clock that only goes forward [s].
            cost: messages that it counts as.
        """
        self._due = max(self._due, now - self._burst / self._rate) + cost / self._rate
        return max(0.0, self._due - now)
