"""The walk in real time: a thread that ticks the simulation, commands in, latest state out.

Nothing waits for the ticks and the ticks wait for nobody: the reference and the push
are single places where the latest value wins, and what pauses, resumes, steps or resets
is a wish that the thread grants between two ticks.
"""

import logging
import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any

from app.pace import Pace, Timing
from walkcore import Command, Parameters, Push, Reference, Robot, Simulation, Snapshot, WalkError

logger = logging.getLogger(__name__)

WISH_TIMEOUT = 0.1  # [s] after which a paused robot looks whether it should stop


class NotPausedError(Exception):
    """Single ticks were asked of a robot that is running."""


@dataclass(frozen=True, slots=True, eq=False)
class LiveState:
    """What is known of the robot after its latest tick."""

    snapshot: Snapshot
    timing: Timing
    running: bool
    """Whether time passes; False while paused."""
    driver: str
    """Who gives the reference: "none", "joystick", "keyboard", "gamepad", "button", "sliders" or "rest"."""
    driver_client: str = ""
    """Which of several browsers that is, where one of them drives."""
    fault: str = ""
    """The unexpected error that paused the robot, where one did."""


@dataclass(frozen=True, slots=True, eq=False)
class _Drive:
    """A reference, whose it is, and when it ends."""

    reference: Reference
    driver: str
    expires_at: float
    """On `time.perf_counter` [s]."""
    client: str = ""
    """The browser whose it is."""


NOBODY = _Drive(Reference(), "none", math.inf)


class Runner:
    """Keeps the tick rate. All methods may be called from any thread."""

    def __init__(self, robot: Robot, parameters: Parameters) -> None:
        """Put the robot at rest and take the first tick, so that there is a state to show.

        Raises:
            WalkError: if the robot cannot stand with these parameters.
        """
        self.robot, self.parameters, self.defaults = robot, parameters, parameters
        self._simulation = Simulation(robot, parameters)
        self._pace = Pace(parameters.control_period)
        self._drive = NOBODY
        self._pushes: deque[Push] = deque(maxlen=1)
        self._wishes: SimpleQueue[tuple[Callable[[], None], Future[LiveState]]] = SimpleQueue()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="runner", daemon=True)
        self._latest = LiveState(self._simulation.step(), self._pace.timing, True, NOBODY.driver)

    @property
    def latest(self) -> LiveState:
        """After the latest tick; a value that does not change."""
        return self._latest

    def start(self) -> None:
        """Let time pass."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()

    @property
    def helm(self) -> tuple[str, str]:
        """Driver and client of the reference given last, ("none", "") once it has expired."""
        drive = self._drive
        return (drive.driver, drive.client) if time.perf_counter() <= drive.expires_at else (NOBODY.driver, "")

    def drive(self, reference: Reference, driver: str, expires_after: float | None = None, client: str = "") -> None:
        """Give the reference from the next tick on.

        Args:
            reference: within the limits of the robot.
            driver: who gives it.
            expires_after: without a new one for so long [s] it becomes zero; None holds it. This is time
                on the wall, not simulated: it guards against a hand that has left or a lost connection,
                and those do not slow down with the simulation.
            client: which of several browsers gives it.

        Raises:
            InvalidValueError: if the reference is beyond a limit.
        """
        self.robot.check_reference(reference)
        expires_at = math.inf if expires_after is None else time.perf_counter() + expires_after
        self._drive = _Drive(reference, driver, expires_at, client)

    def push(self, push: Push) -> None:
        """Begin a push at the next tick.

        Raises:
            InvalidValueError: if it is beyond a limit.
        """
        self._pushes.append(self.robot.check_push(push))

    def pause(self) -> Future[LiveState]:
        """Stop time. This and the following tell the state that they lead to."""
        return self._wish(partial(self._set_running, False))

    def resume(self) -> Future[LiveState]:
        """Let time pass again, after a fault too."""
        return self._wish(partial(self._set_running, True))

    def step(self, ticks: int) -> Future[LiveState]:
        """Take single ticks while paused, as fast as they can be computed; else fail with `NotPausedError`."""
        return self._wish(partial(self._take_ticks, ticks))

    def change(self, values: Mapping[str, Any]) -> Future[LiveState]:
        """Walk on with some parameters changed; fails with a `WalkError`, and changes nothing, where that cannot be."""
        return self._wish(partial(self._change, values))

    def reset(self) -> Future[LiveState]:
        """Put the robot back to rest at tick 0, with no reference and no push; time passes as before."""
        return self._wish(self._start_over)

    def _wish(self, action: Callable[[], None]) -> Future[LiveState]:
        done: Future[LiveState] = Future()
        self._wishes.put((action, done))
        return done

    def _run(self) -> None:
        _take_precedence()
        while not self._stopping.is_set():
            self._grant_wishes()
            if not self._latest.running:
                continue
            self._pace.wait()
            try:
                self._tick()
            except Exception as error:
                self._fail(error)

    def _grant_wishes(self) -> None:
        """Do all that was wished; while paused, wait for it."""
        try:
            while True:
                is_paused = not self._latest.running
                action, done = self._wishes.get(block=is_paused, timeout=WISH_TIMEOUT)
                self._grant(action, done)
        except Empty:
            return

    def _grant(self, action: Callable[[], None], done: Future[LiveState]) -> None:
        if not done.set_running_or_notify_cancel():
            return
        try:
            action()
        except (NotPausedError, WalkError) as refusal:
            done.set_exception(refusal)
        except Exception as error:
            self._fail(error)
            done.set_result(self._latest)
        else:
            done.set_result(self._latest)

    def _tick(self) -> None:
        started = time.perf_counter()
        drive = self._drive
        if drive.expires_at < started:
            drive = NOBODY
        push = self._pushes.popleft() if self._pushes else None
        snapshot = self._simulation.step(Command(drive.reference, push))
        self._pace.record(time.perf_counter() - started)
        self._latest = LiveState(snapshot, self._pace.timing, self._latest.running, drive.driver, drive.client)

    def _set_running(self, running: bool) -> None:
        if running and not self._latest.running:
            self._pace.restart()
        self._latest = replace(self._latest, running=running, fault="" if running else self._latest.fault)

    def _take_ticks(self, ticks: int) -> None:
        if self._latest.running:
            raise NotPausedError("the robot is running; pause it to take single ticks")
        for _ in range(ticks):
            if self._stopping.is_set():
                return
            self._tick()

    def _change(self, values: Mapping[str, Any]) -> None:
        self._simulation.change(self.parameters.changed(values))
        self.parameters = self._simulation.parameters

    def _start_over(self) -> None:
        self._drive = NOBODY
        self._pushes.clear()
        self._simulation.reset()
        self._tick()

    def _fail(self, error: Exception) -> None:
        """An error that the core did not foresee: pause, and tell."""
        logger.error("tick %d failed", self._latest.snapshot.tick + 1, exc_info=error)
        self._latest = replace(self._latest, running=False, fault=f"{type(error).__name__}: {error}")


def _take_precedence() -> None:
    """Let this thread go before others of the machine, a browser's above all, where the system grants it."""
    if hasattr(os, "sched_setscheduler"):
        with suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))  # the thread that asks, not the process
