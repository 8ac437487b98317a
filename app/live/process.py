"""The process in which the control loop runs, so that no page, scene or request can hold up a tick.

The server starts it as `python -m app.live.process SOCKET MEMORY` with two open descriptors. It ends when the server
closes the socket, by dying too, and leaves SIGINT and SIGTERM to the server.
"""

import gc
import logging
import os
import pickle
import select
import signal
import socket
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress

from app.live.channel import ControlMemory
from app.live.control import Control, NothingToSaveError, NotPausedError
from app.live.live_state import LiveState
from app.live.messages import (
    MAX_MESSAGE,
    NoResponseError,
    Request,
    RequestFailedError,
    has_sent,
    reason,
    response_parts,
)
from walkcore import Parameters, WalkError

logger = logging.getLogger(__name__)

MIN_SLACK = 0.002  # [s] that must be left until the next tick for a request, or for other work between two ticks
PUBLISH_PERIOD = 0.008  # [s] between two states of a robot that runs, at least: nobody reads them more often
HEARTBEAT_PERIOD = 0.5  # [s] after which an old state is published again, to show that the process lives
RESEND_PERIOD = 0.001  # [s] between two attempts to send to a server that is slow to read
COLLECTION_PERIOD = 0.25  # [s] between garbage collections, which take 0.3 ms then; after 5 s it was 5 to 10


class ControlProcess:
    """Waits, ticks, and passes requests and responses between the server and the control."""

    def __init__(self, server: socket.socket, memory: ControlMemory) -> None:
        """Use the two ways to the server.

        Args:
            server: for requests and responses.
            memory: for the latest values in both directions.
        """
        self._server, self._memory = server, memory
        self._published_at = self._collected_at = 0.0
        self._parameters: Parameters | None = None
        """The parameters in force, as the server knows them."""
        self._outbox: deque[Iterator[bytes]] = deque()
        """Parts of responses that wait for room in the socket, or for the time between two ticks."""
        self._unsent: bytes | None = None
        """The next part."""

    def run(self) -> None:
        """Tick and handle requests until the server is gone."""
        control = self._create_control()
        if control is None:
            return
        request_real_time_priority()
        gc.freeze()
        gc.disable()  # a collection in the middle of a tick would delay it: it is done between two
        self._collected_at = time.perf_counter()
        while self._is_served(control):
            self._work_between_ticks(control)

    def _is_served(self, control: Control) -> bool:
        """Take the tick that is due, or wait for it and for a request; False once the server is gone."""
        if control.time_left <= 0.0:
            self._take_latest_values(control)
            control.tick()
            return self._handle_request(control, 0.0)  # one at each tick, however little time there is
        slack = control.time_left - MIN_SLACK
        if slack > 0.0:
            return self._handle_request(control, min(slack, self._idle_time))
        time.sleep(max(control.time_left, 0.0))
        return True

    def _work_between_ticks(self, control: Control) -> None:
        self._send_part()
        if control.time_left > MIN_SLACK:
            control.tidy()
        now = time.perf_counter()
        if now > self._published_at + HEARTBEAT_PERIOD:
            self._publish(control.latest)
        if now > self._collected_at + COLLECTION_PERIOD and control.time_left > MIN_SLACK:
            gc.collect()
            gc.freeze()  # what has survived is not searched again: the caches of a walk would take it 4 ms
            self._collected_at = now

    @property
    def _idle_time(self) -> float:
        """Longest wait for a request [s]."""
        if self._unsent is not None:
            return RESEND_PERIOD
        return 0.0 if self._outbox else HEARTBEAT_PERIOD

    def _create_control(self) -> Control | None:
        """The control of the robot in the first message; None if the robot cannot stand."""
        robot, parameters, resumed = pickle.loads(self._server.recv(MAX_MESSAGE))
        self._parameters = parameters
        try:
            control = Control(robot, parameters, self._publish_unless_recent, resumed=resumed)
        except Exception as error:
            self._send(0, error)
            return None
        self._publish(control.latest)
        self._send(0, control.latest)
        return control

    def _handle_request(self, control: Control, timeout: float) -> bool:
        """Handle a request that comes within a timeout [s]; False once the server is gone."""
        if not select.select([self._server], [], [], timeout)[0]:
            return True
        with suppress(ConnectionError):
            if message := self._server.recv(MAX_MESSAGE):
                self._take_latest_values(control)
                self._respond(control, message)
                return True
        return False

    def _respond(self, control: Control, message: bytes) -> None:
        """Carry out a request, unless it has waited for too long; no request ends the process."""
        try:
            request = pickle.loads(message)
            assert isinstance(request, Request)
        except Exception:
            logger.exception("a message of %d bytes is no request", len(message))
            return
        if time.perf_counter() > request.expires_at:
            self._send(request.number, NoResponseError("the control process had no time for it"))
            return
        try:
            response = request.method(control, *request.arguments)
        except (NotPausedError, NothingToSaveError, WalkError) as refusal:
            response = refusal
        except Exception as error:
            logger.exception("a request failed")
            response = RequestFailedError(f"the request failed: {reason(error)}")
        if control.parameters is not self._parameters:
            self._parameters = control.parameters
            self._memory.parameters.write(self._parameters)
        self._publish(control.latest)  # so that whoever has the response finds a state that is no older
        self._send(request.number, response)

    def _take_latest_values(self, control: Control) -> None:
        """Pass on the latest reference and push, where they are new."""
        if (reference := self._memory.reference.take()) is not None:
            control.set_reference(reference)
        if (push := self._memory.push.take()) is not None:
            control.push(push)

    def _send(self, number: int, response: object) -> None:
        """Begin to send a response; a list, which is long, goes after the others."""
        parts = response_parts(number, response)
        if isinstance(response, Iterator):
            self._outbox.append(parts)
        else:
            self._outbox.appendleft(parts)
        self._send_part()

    def _send_part(self) -> None:
        """Send the next part of a response, if there is one and the socket has room for it."""
        while self._unsent is None and self._outbox:
            self._unsent = next(self._outbox[0], None)
            if self._unsent is None:
                self._outbox.popleft()
        if self._unsent is not None and has_sent(self._server, self._unsent):
            self._unsent = None

    def _publish_unless_recent(self, state: LiveState) -> None:
        """Publish a state, unless the robot runs and one was published only just before."""
        if not state.running or time.perf_counter() > self._published_at + PUBLISH_PERIOD:
            self._publish(state)

    def _publish(self, state: LiveState) -> None:
        self._memory.state.write(state)
        self._published_at = time.perf_counter()


def request_real_time_priority() -> None:
    """Go before the other processes of the machine, a browser's above all, where the system permits it."""
    if hasattr(os, "sched_setscheduler"):
        with suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))


def main(server: int, memory: int) -> None:
    """Run until the server is gone.

    Args:
        server: descriptor of the socket.
        memory: descriptor of the shared file.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    ControlProcess(socket.socket(fileno=server), ControlMemory(memory)).run()


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
