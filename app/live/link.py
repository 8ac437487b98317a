"""The server's end of one control process: starts it, sends requests, receives responses, and notices when it dies."""

import logging
import os
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

from app.live.channel import ControlMemory, create_file
from app.live.live_state import LiveState, ReferenceCommand
from app.live.messages import (
    MAX_MESSAGE,
    MessageTooLongError,
    NoResponseError,
    PartKind,
    Request,
    ResponseParts,
    has_sent,
    packed,
)
from app.settings import process_environment
from walkcore import Parameters, Push, Robot

logger = logging.getLogger(__name__)

WATCHDOG_TIMEOUT = 2.0  # [s] without a new state, after which something is wrong with the process
START_TIMEOUT = 120.0  # [s] for the process to put the robot at rest, on a machine however busy
EXIT_TIMEOUT = 2.0  # [s] for the process to end by itself
EXPIRY = 5.0  # [s] after which a request that has not been begun is dropped
MAX_REQUESTS = 64  # under way at once

TakeItem = Callable[[Any], object] | None
"""Function that takes each item of a response, in the thread that receives responses; None drops them."""


class ControlLink:
    """One control process. All methods may be called from any thread."""

    def __init__(self, robot: Robot, parameters: Parameters, resumed: LiveState | None = None) -> None:
        """Start the process, and do not wait for it.

        Args:
            robot: to walk.
            parameters: to begin with.
            resumed: latest state of a walk to go on with; by default the robot begins at rest.
        """
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
        self._started_at, self._parameters = time.perf_counter(), parameters
        self._lock = threading.Lock()
        self._numbers = count(1)
        self.created: Future[LiveState] = Future()
        """The first state of the robot; fails with a `WalkError` if it cannot stand."""
        self._waiting: dict[int, tuple[Future[Any], TakeItem]] = {0: (self.created, None)}
        """Responses that have not come, by the numbers of their requests, and what takes their items."""
        self.end = ""
        """Why the process is gone; empty while it lives."""
        self.ended = threading.Event()
        """Set once the process is gone."""
        has_sent(self._socket, packed((robot, parameters, resumed)))
        self._receiver = threading.Thread(target=self._receive, name="control responses", daemon=True)
        self._receiver.start()

    @property
    def process_id(self) -> int:
        """Id of the process in the system."""
        return self._process.pid

    @property
    def silence(self) -> float:
        """Time since the process was last heard of [s], its start included."""
        return time.perf_counter() - (self._memory.state.written_at or self._started_at)

    @property
    def trouble(self) -> str:
        """Why there is no response to be expected from the process; empty where there is."""
        if self.end:
            return self.end
        if self.created.done() and self.silence > WATCHDOG_TIMEOUT:
            return f"the control process has been silent for {self.silence:.0f} s"
        return ""

    @property
    def last_state(self) -> LiveState:
        """The state after the latest tick that was heard of; the same object until it changes."""
        first = self.created.result()
        return self._memory.state.latest or first

    @property
    def latest(self) -> LiveState:
        """The same, with the trouble that there is with the process."""
        state, trouble = self.last_state, self.trouble
        return replace(state, fault=trouble, running=state.running and not self.end) if trouble else state

    @property
    def parameters(self) -> Parameters:
        """The parameters in force, as the process told them last; the same object until they change."""
        return self._memory.parameters.latest or self._parameters

    def set_reference(self, command: ReferenceCommand) -> None:
        """Leave a reference for the next tick."""
        with self._lock:
            self._memory.reference.write(command)

    def push(self, push: Push) -> None:
        """Leave a push for the next tick."""
        with self._lock:
            self._memory.push.write(push)

    def request(self, method: Callable[..., Any], *arguments: Any, take_item: TakeItem = None) -> Future[Any]:
        """Have a method of `Control` called in the process.

        Args:
            method: of the class.
            arguments: for it.
            take_item: for the items of the iterator that it returned, where it returned one.

        Returns:
            The response; fails with what the method raised, or with `NoResponseError`.
        """
        response: Future[Any] = Future()
        with self._lock:
            number = next(self._numbers)
            starting = 0.0 if self.created.done() else START_TIMEOUT
            request = Request(number, time.perf_counter() + starting + EXPIRY, method, arguments)
            refusal = self._refusal(request)
            if refusal:
                response.set_exception(NoResponseError(refusal))
            else:
                self._waiting[number] = (response, take_item)
        return response

    def _refusal(self, request: Request) -> str:
        """Why a request could not be sent; empty if it was."""
        if self.trouble:
            return self.trouble
        try:
            message = packed(request)
        except MessageTooLongError as error:
            return str(error)
        if len(self._waiting) < MAX_REQUESTS and has_sent(self._socket, message):
            return ""
        return "the control process is too busy; try again"

    def kill(self) -> None:
        """End the process at once; what waits for a response fails."""
        self._process.kill()

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

    def _receive(self) -> None:
        parts = ResponseParts()
        try:
            with suppress(ConnectionError):
                while message := self._socket.recv(MAX_MESSAGE):
                    try:
                        if (complete := parts.add(message)) is not None:
                            self._deliver(*complete)
                    except Exception:  # one bad message does not end the thread
                        logger.exception("a message of %d bytes is no response", len(message))
        finally:
            self._fail_all()

    def _fail_all(self) -> None:
        """Fail all requests under way: there will be no response."""
        self._process.wait()
        with self._lock:
            self.end = f"the control process has ended: {_exit_reason(self._process.returncode)}; it starts again"
            waiting, self._waiting = self._waiting, {}
        self.ended.set()
        for response, _ in waiting.values():
            if response.set_running_or_notify_cancel():
                response.set_exception(NoResponseError(self.end))

    def _deliver(self, number: int, kind: PartKind, value: Any) -> None:
        """Give an item, or the value that ends a response, to the request of that number."""
        with self._lock:  # which whoever requests holds until the number is known
            waiting = self._waiting.get(number) if kind == PartKind.ITEM else self._waiting.pop(number, None)
        response, take_item = waiting or (None, None)
        if kind == PartKind.ITEM:
            if take_item is not None:
                take_item(value)
        elif response is not None and response.set_running_or_notify_cancel():
            if isinstance(value, Exception):
                response.set_exception(value)
            else:
                response.set_result(value)


def _exit_reason(code: int) -> str:
    return f"exit code {code}" if code >= 0 else signal.Signals(-code).name
