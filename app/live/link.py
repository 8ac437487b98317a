"""The server's end of one control process: starts it, sends requests, receives responses, and notices when it dies."""

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

from app.live.channel import MAX_MESSAGE, Chunk, ControlMemory, create_file
from app.live.live_state import LiveState, ReferenceCommand
from app.settings import process_environment
from walkcore import Parameters, Push, Robot

WATCHDOG_TIMEOUT = 2.0  # [s] without a new state, after which something is wrong with the process
EXIT_TIMEOUT = 2.0  # [s] for the process to end by itself


class NoResponseError(Exception):
    """The control process is gone, or has no time for more requests."""


class ControlLink:
    """One control process. All methods may be called from any thread."""

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
            env=process_environment(),
            process_group=0,  # Ctrl-C in a terminal is for the server, which then closes the socket
        )
        theirs.close()
        os.close(file)
        self._lock = threading.Lock()
        self._numbers = count(1)
        self.created: Future[LiveState] = Future()
        """The first state of the robot; fails with a `WalkError` if it cannot stand."""
        self._waiting: dict[int, tuple[Future[Any], Callable[[Any], Any]]] = {0: (self.created, _unchanged)}
        self._chunks: dict[int, list[Any]] = {}
        """Values received so far of responses that come in chunks, by the numbers of their requests."""
        self._seen: tuple[int, float, LiveState] | None = None
        self.end = ""
        """Why the process is gone; empty while it lives."""
        self._send((robot, parameters))
        self._receiver = threading.Thread(target=self._receive, name="control responses", daemon=True)
        self._receiver.start()

    @property
    def process_id(self) -> int:
        """Id of the process in the system."""
        return self._process.pid

    @property
    def latest(self) -> LiveState:
        """The state after the latest tick, or after the last one there was; the same object until it changes."""
        self.created.result()
        memory = self._memory.state
        seen = self._seen
        if seen is None or seen[0] != memory.count:
            message = memory.read()
            seen = self._seen = (message.count, message.written_at, pickle.loads(message.data))
        _, written_at, state = seen
        if self.end:
            return replace(state, running=False, fault=self.end)
        age = time.perf_counter() - written_at
        if age > WATCHDOG_TIMEOUT:
            return replace(state, fault=f"the control process has been silent for {age:.0f} s")
        return state

    def set_reference(self, command: ReferenceCommand) -> None:
        """Leave a reference for the next tick."""
        with self._lock:
            self._memory.reference.write(pickle.dumps(command))

    def push(self, push: Push) -> None:
        """Leave a push for the next tick."""
        with self._lock:
            self._memory.push.write(pickle.dumps(push))

    def request(
        self, method: Callable[..., Any], *arguments: Any, convert: Callable[[Any], Any] | None = None
    ) -> Future[Any]:
        """Have a method of `Control` called in the process.

        Args:
            method: of the class.
            arguments: for it.
            convert: applied to what it returned, in the thread that receives responses.

        Returns:
            The response; fails with what the method raised, or with `NoResponseError`.
        """
        response: Future[Any] = Future()
        with self._lock:
            number = next(self._numbers)
            self._waiting[number] = (response, convert or _unchanged)
            if self.end or not self._send((number, method, arguments)):
                del self._waiting[number]
                response.set_exception(NoResponseError(self.end or "the control process is too busy; try again"))
        return response

    def close(self) -> None:
        """End the process; forcibly, where it does not end by itself."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        try:
            self._process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._receiver.join()
        self._socket.close()

    def _send(self, message: Any) -> bool:
        """Send a message; False if the socket has no room for it."""
        try:
            self._socket.send(pickle.dumps(message), socket.MSG_DONTWAIT)
        except (BlockingIOError, ConnectionError):
            return False
        return True

    def _receive(self) -> None:
        try:
            with suppress(ConnectionError):
                while message := self._socket.recv(MAX_MESSAGE):
                    self._deliver(*pickle.loads(message))
        finally:
            self._fail_all()

    def _fail_all(self) -> None:
        """Fail all requests under way: there will be no response."""
        self._process.wait()
        with self._lock:
            self.end = f"the control process has ended: {_reason(self._process.returncode)}; reset starts it again"
            waiting, self._waiting = self._waiting, {}
        for response, _ in waiting.values():
            if response.set_running_or_notify_cancel():
                response.set_exception(NoResponseError(self.end))

    def _deliver(self, number: int, value: Any) -> None:
        """Give a response to the request of that number, once it is complete."""
        if isinstance(value, Chunk):
            chunks = self._chunks.setdefault(number, [])
            if not value.is_last:
                chunks.append(value.value)
                return
            value = self._chunks.pop(number)
        with self._lock:
            response, convert = self._waiting.pop(number)
        if not response.set_running_or_notify_cancel():
            return
        if isinstance(value, Exception):
            response.set_exception(value)
        else:
            response.set_result(convert(value))


def _unchanged(value: Any) -> Any:
    return value


def _reason(code: int) -> str:
    return f"exit code {code}" if code >= 0 else signal.Signals(-code).name
