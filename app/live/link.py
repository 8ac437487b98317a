"""One control process and the way to it: starts it, takes its answers, and notices when it dies."""

import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from itertools import count
from typing import Any

from app.live.channel import MAX_MESSAGE, ControlMemory, Part, create_file
from app.live.control import Drive
from app.live.state import LiveState
from walkcore import Parameters, Push, Robot

SILENCE = 2.0  # [s] without a word from the process, after which something is wrong with it
GRACE = 2.0  # [s] for it to end by itself


class NoAnswerError(Exception):
    """The control process is gone, or has no time for more wishes."""


class ControlLink:
    """A control process of its own. All methods may be called from any thread."""

    def __init__(self, robot: Robot, parameters: Parameters) -> None:
        """Start the process, and do not wait for it."""
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        file = create_file()
        self._memory = ControlMemory(file)
        self._process = subprocess.Popen(
            # -P: a folder named app where the user stands is not ours.
            [sys.executable, "-P", "-m", "app.live.process", str(theirs.fileno()), str(file)],
            pass_fds=(theirs.fileno(), file),
            stdin=subprocess.DEVNULL,
            process_group=0,  # Ctrl-C in a terminal is for the server, which then closes the socket
        )
        theirs.close()
        os.close(file)
        self._lock = threading.Lock()
        self._numbers = count(1)
        self.created: Future[LiveState] = Future()
        """The first state of the robot; fails with a `WalkError` if it cannot stand."""
        self._waiting: dict[int, tuple[Future[Any], Callable[[Any], Any]]] = {0: (self.created, _as_it_is)}
        self._parts: dict[int, list[Any]] = {}
        """Of answers of which more is to come."""
        self._seen: tuple[int, float, LiveState] | None = None
        self.end = ""
        """Why the process is gone; empty while it lives."""
        self._send((robot, parameters))
        self._reader = threading.Thread(target=self._read, name="control answers", daemon=True)
        self._reader.start()

    @property
    def process_id(self) -> int:
        """As the system counts."""
        return self._process.pid

    @property
    def latest(self) -> LiveState:
        """After the latest tick, or after the last one there was."""
        self.created.result()
        letter = self._memory.state
        seen = self._seen
        if seen is None or seen[0] != letter.count:
            read = letter.read()
            seen = self._seen = (read.count, read.at, pickle.loads(read.data))
        _, at, state = seen
        if self.end:
            return replace(state, running=False, fault=self.end)
        silence = time.perf_counter() - at
        if silence > SILENCE:
            return replace(state, fault=f"the control process has been silent for {silence:.0f} s")
        return state

    def drive(self, drive: Drive) -> None:
        """Leave a reference for the next tick."""
        with self._lock:
            self._memory.drive.write(pickle.dumps(drive))

    def push(self, push: Push) -> None:
        """Leave a push for the next tick."""
        with self._lock:
            self._memory.push.write(pickle.dumps(push))

    def wish(
        self, action: Callable[..., Any], *arguments: Any, then: Callable[[Any], Any] | None = None
    ) -> Future[Any]:
        """Have a method of `Control` called there.

        Args:
            action: the method.
            arguments: for it.
            then: makes of what it returned what the answer is; in the thread that reads the answers.

        Returns:
            Its answer; fails with what it raised, or with `NoAnswerError`.
        """
        answer: Future[Any] = Future()
        with self._lock:
            number = next(self._numbers)
            self._waiting[number] = (answer, then or _as_it_is)
            if self.end or not self._send((number, action, arguments)):
                del self._waiting[number]
                answer.set_exception(NoAnswerError(self.end or "the control process is too busy; try again"))
        return answer

    def close(self) -> None:
        """End the process; forcibly, where it does not end by itself."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        try:
            self._process.wait(GRACE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()
        self._socket.close()

    def _send(self, message: Any) -> bool:
        """Whether there was room for it."""
        try:
            self._socket.send(pickle.dumps(message), socket.MSG_DONTWAIT)
        except (BlockingIOError, ConnectionError):
            return False
        return True

    def _read(self) -> None:
        try:
            with suppress(ConnectionError):
                while message := self._socket.recv(MAX_MESSAGE):
                    self._take(*pickle.loads(message))
        finally:
            self._give_up()

    def _give_up(self) -> None:
        """Tell everybody who waits that there will be no answer."""
        self._process.wait()
        with self._lock:
            self.end = f"the control process has ended: {_why(self._process.returncode)}; reset starts it again"
            waiting, self._waiting = self._waiting, {}
        for answer, _ in waiting.values():
            if answer.set_running_or_notify_cancel():
                answer.set_exception(NoAnswerError(self.end))

    def _take(self, number: int, outcome: Any) -> None:
        if isinstance(outcome, Part):
            parts = self._parts.setdefault(number, [])
            if not outcome.is_last:
                parts.append(outcome.value)
                return
            outcome = self._parts.pop(number)
        with self._lock:
            answer, then = self._waiting.pop(number)
        if not answer.set_running_or_notify_cancel():
            return
        if isinstance(outcome, Exception):
            answer.set_exception(outcome)
        else:
            answer.set_result(then(outcome))


def _as_it_is(outcome: Any) -> Any:
    return outcome


def _why(code: int) -> str:
    return f"exit code {code}" if code >= 0 else signal.Signals(-code).name
