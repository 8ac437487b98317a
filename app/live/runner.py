"""The robot that walks in real time, as the server sees it: wishes in, latest state out.

The walk itself goes on in a process of its own, `app.live.process`. Nothing waits for its ticks
and its ticks wait for nobody: state, reference and push are single places in shared memory where
the latest value wins, and what pauses, resumes, steps or resets is a wish with an answer.
"""

import math
import random
import time
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

from app.live.control import NOBODY, Control, Drive, NothingToSaveError, NotPausedError
from app.live.link import ControlLink, NoAnswerError
from app.live.session import Session
from app.live.state import LiveState, RandomPushes
from walkcore import Parameters, Push, Reference, Robot, Snapshot
from walkcore.values import check_range

__all__ = ["NOBODY", "LiveState", "NoAnswerError", "NotPausedError", "NothingToSaveError", "Runner"]

SPEEDS = (0.1, 4.0)  # simulated over real time
INTERVALS = (0.2, 60.0)  # [s] between random pushes


class Runner:
    """Drives the control process. All methods may be called from any thread.

    Wishes are answered with the state that they lead to. They fail with `NoAnswerError` if the process is gone.
    """

    def __init__(self, robot: Robot, parameters: Parameters) -> None:
        """Begin to put the robot at rest. Whoever asks first how it is waits until it stands."""
        self.robot, self.parameters, self.defaults = robot, parameters, parameters
        self._link = ControlLink(robot, parameters)
        self._before_restart: LiveState | None = None
        self._drive, self._expires_at = NOBODY, math.inf

    @property
    def latest(self) -> LiveState:
        """After the latest tick; a value that does not change.

        Raises:
            WalkError: if the robot cannot stand with its parameters.
        """
        if self._before_restart is not None and not self._link.created.done():
            return replace(self._before_restart, running=False, fault="the control process is starting again")
        return self._link.latest

    @property
    def helm(self) -> tuple[str, str]:
        """Driver and client of the reference given last, ("none", "") once it has expired."""
        drive = self._drive if time.perf_counter() <= self._expires_at else NOBODY
        return drive.driver, drive.client

    @property
    def process_id(self) -> int:
        """Of the control process."""
        return self._link.process_id

    def wait(self) -> None:
        """Until the robot stands.

        Raises:
            WalkError: if it cannot stand with its parameters.
        """
        self._link.created.result()

    def start(self) -> None:
        """Let time pass."""
        self._link.wish(Control.start)

    def stop(self) -> None:
        """End the process."""
        self._link.close()

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
        lasts = math.inf if expires_after is None else expires_after
        self._drive, self._expires_at = Drive(reference, driver, lasts, client), time.perf_counter() + lasts
        self._link.drive(self._drive)

    def push(self, push: Push) -> None:
        """Begin a push at the next tick.

        Raises:
            InvalidValueError: if it is beyond a limit.
        """
        self._link.push(self.robot.check_push(push))

    def pause(self) -> Future[LiveState]:
        """Stop time."""
        return self._link.wish(Control.pause)

    def resume(self) -> Future[LiveState]:
        """Let time pass again, after a fault too."""
        return self._link.wish(Control.resume)

    def step(self, ticks: int) -> Future[LiveState]:
        """Take single ticks while paused, as fast as they can be computed; else fail with `NotPausedError`."""
        return self._link.wish(Control.step, ticks)

    def step_samples(self, samples: int) -> Future[LiveState]:
        """Take the ticks up to the next sample of the gait's grid, or to the one so many samples on; as `step`."""
        return self._link.wish(Control.step_samples, samples)

    def change(self, values: Mapping[str, Any]) -> Future[Parameters]:
        """Walk on with some parameters changed; fails with a `WalkError`, and changes nothing, where that cannot be."""
        return self._link.wish(Control.change, dict(values), then=self._take_parameters)

    def reset(self) -> Future[LiveState]:
        """Put the robot back to rest at tick 0, with no reference and no push; time passes as before.

        A control process that is gone is started again, and time passes.
        """
        self._drive = NOBODY
        if not self._link.end:
            return self._link.wish(Control.reset)
        self._before_restart = self._link.latest
        self._link.close()
        self._link = ControlLink(self.robot, self.parameters)
        return self._link.wish(Control.start)

    def set_speed(self, factor: float) -> Future[LiveState]:
        """Let simulated time pass so many times as fast as real time.

        Raises:
            InvalidValueError: if the factor is beyond `SPEEDS`.
        """
        return self._link.wish(Control.set_speed, check_range("speed.factor", factor, *SPEEDS))

    def preview(self, push: Push) -> Future[Snapshot]:
        """What the next tick would be if this push came now, all at once, without the body; the robot does not feel it.

        Raises:
            InvalidValueError: if it is beyond a limit.
        """
        return self._link.wish(Control.preview, self.robot.check_push(push))

    def push_at_random(self, strength: float, interval: float, seed: int | None = None) -> Future[LiveState]:
        """Let pushes come by themselves.

        Args:
            strength: of the strongest [N s]; none come if it is zero.
            interval: mean time from one to the next [s].
            seed: the same seed gives the same pushes; drawn if none is given.

        Raises:
            InvalidValueError: if one is beyond its limit.
        """
        check_range("random_pushes.strength", strength, 0.0, self.robot.max_push)
        check_range("random_pushes.interval", interval, *INTERVALS)
        seed = random.randrange(2**32) if seed is None else seed
        return self._link.wish(Control.push_at_random, RandomPushes(strength, interval, seed) if strength else None)

    def save(self, is_before_reset: bool = False) -> Future[Session]:
        """What happened in the last minute since the last reset, or in that of the walk before it.

        Fails with `NothingToSaveError` if there was none.
        """
        return self._link.wish(Control.save, is_before_reset, then=Session.unpacked)

    def _take_parameters(self, parameters: Parameters) -> Parameters:
        self.parameters = parameters
        return parameters
