"""Starts the control process again where it ends or hangs, and lets the walk go on from its latest state.

A process that was killed leaves its latest state in the shared memory; the next one restores it. Where that one ends
soon, too, the state may be what ends it: the robot then stands at rest, and the next starts come more and more slowly.
"""

import logging
import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace

from app.live.control import Control
from app.live.link import START_TIMEOUT, ControlLink
from app.live.live_state import LiveState
from app.live.messages import NoResponseError
from walkcore import Parameters, Robot

logger = logging.getLogger(__name__)

WATCH_PERIOD = 0.25  # [s] between two looks at the process
HANG_TIMEOUT = 5.0  # [s] of silence after which the process is killed
SOON = 5.0  # [s] from when the robot stood, or walked on, within which the end of a process is one too many
MAX_PAUSE = 30.0  # [s] before a start, after many that did not last


class Supervisor:
    """Owner of the control process of a robot, one after the other. All methods may be called from any thread."""

    def __init__(self, robot: Robot, parameters: Parameters, on_restart: Callable[[ControlLink], None]) -> None:
        """Start the process, and do not wait for it.

        Args:
            robot: to walk.
            parameters: to begin with.
            on_restart: called with each further link before time passes there.
        """
        self._robot, self._on_restart = robot, on_restart
        self._link = ControlLink(robot, parameters)
        self._ready_at, self._pause = math.inf, 0.0
        self._is_restart = self._is_time_passing = False
        self._resumed: LiveState | None = None
        """Latest state of the walk, with which the next process goes on."""
        self._before: LiveState | None = None
        """The same as it is shown until that process is ready."""
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="control supervisor", daemon=True)
        self._thread.start()

    @property
    def process_id(self) -> int:
        """Id of the present process in the system."""
        return self._link.process_id

    @property
    def parameters(self) -> Parameters:
        """The parameters in force, with which the next process begins."""
        return self._link.parameters

    @property
    def trouble(self) -> str:
        """Why the robot cannot be commanded at the moment; empty where it can."""
        if self._is_starting_again:
            return "the control process is starting again"
        return self._link.trouble

    @property
    def link(self) -> ControlLink:
        """The present process, which responds.

        Raises:
            NoResponseError: if it does not at the moment.
        """
        if trouble := self.trouble:
            raise NoResponseError(trouble)
        return self._link

    @property
    def latest(self) -> LiveState:
        """The latest state there is, with the trouble as its fault; the same object until it changes.

        Raises:
            WalkError: if the robot cannot stand with its parameters.
        """
        link, before = self._link, self._before
        return before if before is not None and not _is_created(link) else link.latest

    def wait(self) -> None:
        """Wait for the first process to put the robot at rest; raises as `latest` does."""
        self._link.created.result()

    def start(self) -> None:
        """Let time pass, in each process that follows, too."""
        self._is_time_passing = True
        self._link.request(Control.start)

    def stop(self) -> None:
        """End the process for good."""
        self._stopped.set()
        self._link.ended.set()
        self._thread.join()
        self._link.close()

    @property
    def _is_starting_again(self) -> bool:
        return self._is_restart and not _is_created(self._link)

    def _watch(self) -> None:
        silence, last = 0.0, time.monotonic()
        while not self._stopped.is_set():
            self._link.ended.wait(WATCH_PERIOD)
            if self._stopped.is_set():
                return
            now = time.monotonic()
            # What this process slept itself, with the whole machine, is no silence of the other.
            silence = min(self._link.silence, silence + min(now - last, 2.0 * WATCH_PERIOD))
            last = now
            if self._link.created.done():
                self._ready_at = min(self._ready_at, now)
            try:
                if self._link.ended.is_set():
                    silence = 0.0
                    self._restart()
                elif silence > (HANG_TIMEOUT if self._link.created.done() else START_TIMEOUT):
                    logger.warning("the control process hangs and is killed")
                    self._link.kill()
                    self._link.ended.wait(HANG_TIMEOUT)
            except Exception:
                logger.exception("the control process cannot be started again")
                self._stopped.wait(MAX_PAUSE)

    def _restart(self) -> None:
        """Start another process in place of the one that has ended."""
        ended = self._link
        if not self._is_restart and not _is_created(ended):  # it could never stand: whoever waits for it is told
            self._stopped.wait()
            return
        did_last = time.monotonic() - self._ready_at > SOON
        self._pause = 0.0 if did_last or not self._is_restart else min(2.0 * self._pause + 0.5, MAX_PAUSE)
        if _is_created(ended):
            self._resumed, self._before = ended.last_state, ended.latest
        logger.warning("%s", ended.end)
        if self._stopped.wait(self._pause):
            return
        ended.close()
        assert self._resumed is not None
        if self._is_restart and not did_last:  # the state may be what ends it: speed and pause go on without it
            self._resumed = replace(self._resumed, next_state=None)
        self._ready_at, self._is_restart = math.inf, True
        self._link = link = ControlLink(self._robot, ended.parameters, self._resumed)
        self._on_restart(link)
        if self._is_time_passing:
            link.request(Control.start)


def _is_created(link: ControlLink) -> bool:
    """Whether the robot stands, or walks, in the process of a link."""
    return link.created.done() and link.created.exception() is None
