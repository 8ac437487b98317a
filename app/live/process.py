"""The process in which the control loop runs, so that no page, scene or request can hold up a tick.

The server starts it as `python -m app.live.process SOCKET MEMORY` with two open descriptors.
It ends when the server closes the socket, by dying too, and leaves SIGINT and SIGTERM to the server.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: threads only fight over such small matrices

import gc
import logging
import pickle
import select
import signal
import socket
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

from app.live.channel import MAX_MESSAGE, ControlMemory, Part
from app.live.control import Control, NothingToSaveError, NotPausedError
from app.live.state import LiveState
from walkcore import WalkError

ROOM = 0.002  # [s] before the next tick that a wish is given at least
PUBLISH_PERIOD = 0.008  # [s] at least between two states of a robot that runs: nobody looks more often
BEAT_PERIOD = 0.5  # [s] after which a state is published again, to show that somebody is there
CLEANING_PERIOD = 0.25  # [s]; what has come since takes 0.3 ms to look through, after 5 s it was 5 to 10


class ControlProcess:
    """Waits, ticks, and passes on between the server and the control."""

    def __init__(self, server: socket.socket, memory: ControlMemory) -> None:
        """Talk to the server by these two."""
        self._server, self._memory = server, memory
        self._published_at = self._cleaned_at = 0.0
        self._seen_drive = self._seen_push = 0
        self._outbox: deque[tuple[int, Any]] = deque()
        """Answers that wait for room on the way, with the numbers of their wishes."""

    def run(self) -> None:
        """Do what the server asks until it is gone."""
        control = self._created()
        if control is None:
            return
        take_precedence()
        gc.freeze()
        gc.disable()  # a collection in the middle of a tick would delay it: it is one of the chores
        self._cleaned_at = time.perf_counter()
        while self._go_on(control):
            self._do_chores(control)

    def _go_on(self, control: Control) -> bool:
        """Tick where one is due, and wait for it or for a wish; false once the server is gone."""
        if control.time_left <= 0.0:
            self._take_wishes_without_answer(control)
            control.tick()
            return self._grant_one(control, 0.0)  # one at each tick, however little time there is
        room = control.time_left - ROOM
        if room > 0.0:
            return self._grant_one(control, 0.0 if self._outbox else min(room, BEAT_PERIOD))
        time.sleep(max(control.time_left, 0.0))
        return True

    def _do_chores(self, control: Control) -> None:
        if self._outbox and self._has_sent(*self._outbox[0]):
            self._outbox.popleft()
        if control.time_left > ROOM:
            control.tidy()
        now = time.perf_counter()
        if now > self._published_at + BEAT_PERIOD:
            self._publish(control.latest)
        if now > self._cleaned_at + CLEANING_PERIOD and control.time_left > ROOM:
            gc.collect()
            gc.freeze()  # what has stayed is looked through no more: the caches of a walk would take it 4 ms
            self._cleaned_at = now

    def _created(self) -> Control | None:
        """The control of the robot that the first message brings; none if there is no such."""
        robot, parameters = pickle.loads(self._server.recv(MAX_MESSAGE))
        try:
            control = Control(robot, parameters, self._publish_in_time)
        except Exception as error:
            self._has_sent(0, error)
            return None
        self._has_sent(0, control.latest)
        return control

    def _grant_one(self, control: Control, patience: float) -> bool:
        """Grant a wish that comes within some seconds; false once the server is gone."""
        if not select.select([self._server], [], [], patience)[0]:
            return True
        with suppress(ConnectionError):
            if message := self._server.recv(MAX_MESSAGE):
                self._take_wishes_without_answer(control)
                self._grant(control, *pickle.loads(message))
                return True
        return False

    def _grant(self, control: Control, number: int, action: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        try:
            outcome = action(control, *arguments)
        except (NotPausedError, NothingToSaveError, WalkError) as refusal:
            outcome = refusal
        except Exception as error:
            outcome = control.fail(error)
        self._publish(control.latest)  # so that who has the answer finds a state that is no older
        if isinstance(outcome, Iterator):
            self._outbox.extend((number, Part(value)) for value in outcome)
            self._outbox.append((number, Part(is_last=True)))
        elif not self._has_sent(number, outcome):
            self._outbox.append((number, outcome))

    def _take_wishes_without_answer(self, control: Control) -> None:
        """The latest reference and push."""
        if self._memory.drive.count != self._seen_drive:
            letter = self._memory.drive.read()
            self._seen_drive = letter.count
            control.drive(pickle.loads(letter.data))
        if self._memory.push.count != self._seen_push:
            letter = self._memory.push.read()
            self._seen_push = letter.count
            control.push(pickle.loads(letter.data))

    def _has_sent(self, number: int, outcome: Any) -> bool:
        """Send an answer; whether there was room for it on the way to a server that is slow to read."""
        with suppress(ConnectionError):  # the server is gone: the next read tells
            try:
                self._server.send(pickle.dumps((number, outcome), pickle.HIGHEST_PROTOCOL), socket.MSG_DONTWAIT)
            except BlockingIOError:
                return False
        return True

    def _publish_in_time(self, state: LiveState) -> None:
        """Publish a state, but no more of them than anybody can look at."""
        if not state.running or time.perf_counter() > self._published_at + PUBLISH_PERIOD:
            self._publish(state)

    def _publish(self, state: LiveState) -> None:
        self._memory.state.write(pickle.dumps(state, pickle.HIGHEST_PROTOCOL))
        self._published_at = time.perf_counter()


def take_precedence() -> None:
    """Go before other processes of the machine, a browser's above all, where the system grants it."""
    if hasattr(os, "sched_setscheduler"):
        with suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))


def main(server: int, memory: int) -> None:
    """Run with two open descriptors."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    ControlProcess(socket.socket(fileno=server), ControlMemory(memory)).run()


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
