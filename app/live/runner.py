"""The robot that walks in real time, as the server sees it: commands and requests in, latest state out.

The walk itself goes on in a process of its own, `app.live.process`. Nothing waits for its ticks and its ticks wait
for nobody: state, parameters, reference and push are values in shared memory, of which the latest wins, and what
pauses, resumes, steps or resets is a request with a response.
"""

import math
import random
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, lru_cache, wraps
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Concatenate, ParamSpec, TypeVar

from app.live.control import Control
from app.live.fork import Fork
from app.live.link import TakeItem
from app.live.live_state import NO_REFERENCE, LiveState, RandomPushes, ReferenceCommand
from app.live.messages import NoResponseError
from app.live.parameter_changes import ParameterChanges
from app.live.push_roses import PushRoses
from app.live.session_log import PackedSegment
from app.live.supervisor import Supervisor
from walkcore import Parameters, Push, Reference, Robot, Snapshot
from walkcore.analysis.push_rose import PushRose
from walkcore.errors import InvalidValueError
from walkcore.motion.whole_body import WholeBody
from walkcore.values import check_range

SPEEDS = (0.1, 4.0)  # limits of simulated over real time
INTERVALS = (0.2, 60.0)  # [s], limits of the time between random pushes
ATTENTION = 120.0  # [s] after which a robot at rest that nobody looks at falls asleep
ATTENTION_PERIOD = 1.0  # [s] between two messages that somebody looks
BEGINNINGS = (Control.reset, Control.choose_plant, Control.begin, Control.fork)
"""Requests that begin another walk, which follows no reference yet, and set the present one aside."""
P = ParamSpec("P")
T = TypeVar("T")


def requesting(method: Callable[Concatenate[Control, P], T]) -> Callable[Concatenate["Runner", P], Future[T]]:
    """A method of `Runner` that requests one of `Control`: nothing is to be checked in between."""

    @wraps(method)
    def request(self: "Runner", *arguments: P.args, **named: P.kwargs) -> Future[T]:
        assert not named, "a message has arguments by position only"
        return self._request(method, *arguments)

    return request


class Runner:
    """Drives the control process. All methods may be called from any thread.

    Requests are futures of what the method of `Control` returns or raises. They fail with `NoResponseError` where the
    process is gone or hangs; it is then started again by itself, and the walk goes on.
    """

    def __init__(self, robot: Robot, parameters: Parameters) -> None:
        """Begin to put the robot at rest; `latest` waits until it stands."""
        self.robot, self.defaults = robot, parameters
        self._command = NO_REFERENCE
        self.is_first_walk = True
        """Whether the robot has not begun anew since time passes: there is no walk before the present one."""
        self._is_started, self._attended_at = False, -math.inf
        self._supervisor = Supervisor(robot, parameters, lambda link: link.set_reference(self._held))
        self._changes = ParameterChanges(robot, self._supervisor)
        self.push_roses = PushRoses(robot, lambda: self._supervisor.latest, lambda: self.parameters)
        """Roses of pushes for `latest`, while somebody asks for them."""

    @property
    def parameters(self) -> Parameters:
        """The parameters in force."""
        return self._supervisor.parameters

    @property
    def latest(self) -> LiveState:
        """The state after the latest tick; a value that does not change, the same object until there is a newer one.

        Raises:
            WalkError: if the robot cannot stand with its parameters.
        """
        state, rose = self._supervisor.latest, self.push_roses.latest
        return state if rose is None else _with_rose(state, rose)

    def look(self) -> LiveState:
        """The latest state, for somebody who wants to see the robot: it does not fall asleep, or wakes up."""
        self._attend()
        return self.latest

    def _attend(self) -> None:
        """Tell the control process, now and then, that somebody looks or asks."""
        now = time.monotonic()
        if now > self._attended_at + ATTENTION_PERIOD:
            self._attended_at = now
            with suppress(NoResponseError):
                self._supervisor.link.request(Control.attend, ATTENTION)

    @property
    def trouble(self) -> str:
        """Why the robot cannot be commanded at the moment; empty where it can."""
        return self._supervisor.trouble

    @property
    def active_driver(self) -> tuple[str, str]:
        """Driver and client of the latest reference, ("none", "") once it has expired."""
        held = self._held
        return held.driver, held.client

    @property
    def _held(self) -> ReferenceCommand:
        """The reference that still holds."""
        return self._command if time.perf_counter() <= self._command.expires_at else NO_REFERENCE

    @property
    def process_id(self) -> int:
        """Id of the control process in the system."""
        return self._supervisor.process_id

    def wait(self) -> None:
        """Wait until the robot stands.

        Raises:
            WalkError: if it cannot stand with its parameters.
        """
        self._supervisor.wait()

    def start(self) -> None:
        """Let time pass."""
        self._is_started = True
        self._supervisor.start()
        self._attend()

    def stop(self) -> None:
        """End the process."""
        self.push_roses.stop()
        self._supervisor.stop()
        self._changes.stop()

    def drive(self, reference: Reference, driver: str, expires_after: float | None = None, client: str = "") -> None:
        """Follow a reference from the next tick on.

        Args:
            reference: within the limits of the robot.
            driver: kind of source, as in `ReferenceCommand`.
            expires_after: without a new one for so long [s] it becomes zero; None holds it. This is time on the wall,
                not simulated: it guards against a person who has left or a lost connection, and those do not slow
                down with the simulation.
            client: name of the browser that gives it.

        Raises:
            InvalidValueError: if the reference is beyond a limit.
            NoResponseError: if the control process does not respond at the moment.
        """
        self.robot.check_reference(reference)
        self._attend()
        link = self._supervisor.link
        expires_at = math.inf if expires_after is None else time.perf_counter() + expires_after
        self._command = ReferenceCommand(reference, driver, expires_at, client)
        link.set_reference(self._command)

    def push(self, push: Push) -> None:
        """Begin a push at the next tick.

        Raises:
            InvalidValueError: if it is beyond a limit, or on a link that the robot does not have.
            NoResponseError: if the control process does not respond at the moment.
        """
        checked = self._checked_push(push)
        self._attend()
        self._supervisor.link.push(checked)

    @cached_property
    def links(self) -> tuple[str, ...]:
        """Joints that move the links that can be pushed, by name; none of a point mass."""
        return () if self.robot.body is None else WholeBody(self.robot.body).joint_names

    def _checked_push(self, push: Push) -> Push:
        if push.link and push.link not in self.links:
            limit = (
                f"must be one of {', '.join(self.links)}" if self.links else "must be empty: this robot is a point mass"
            )
            raise InvalidValueError("push.link", push.link, limit)
        return self.robot.check_push(push)

    pause = requesting(Control.pause)
    resume = requesting(Control.resume)
    step = requesting(Control.step)
    step_samples = requesting(Control.step_samples)
    reset = requesting(Control.reset)
    choose_plant = requesting(Control.choose_plant)
    begin = requesting(Control.begin)
    timeline = requesting(Control.timeline)
    past = requesting(Control.past)

    def change(self, values: Mapping[str, Any]) -> Future[Parameters]:
        """Walk on with some parameters changed; fails with a `WalkError`, and changes nothing, where that cannot be.

        Another plant holds for a whole walk, so the robot begins anew with it.
        """
        if values.get("plant", self.parameters.plant) != self.parameters.plant:
            return self.begin(values, {})
        return self._changes.request(values)

    def set_speed(self, factor: float) -> Future[LiveState]:
        """Let simulated time pass `factor` times as fast as real time.

        Raises:
            InvalidValueError: if the factor is beyond `SPEEDS`.
        """
        return self._request(Control.set_speed, check_range("speed.factor", factor, *SPEEDS))

    def preview(self, push: Push) -> Future[Snapshot]:
        """The next tick as it would be if a push came now, all at once, without the body; the robot does not feel it.

        Raises:
            InvalidValueError: if the push is beyond a limit.
        """
        return self._request(Control.preview, self.robot.check_push(push))

    def push_at_random(self, strength: float, interval: float, seed: int | None = None) -> Future[LiveState]:
        """Let pushes come by themselves.

        Args:
            strength: impulse of the strongest [N s]; zero ends them.
            interval: mean time from one to the next [s].
            seed: the same seed gives the same pushes; None draws one.

        Raises:
            InvalidValueError: if one is beyond its limit.
        """
        check_range("random_pushes.strength", strength, 0.0, self.robot.max_push)
        check_range("random_pushes.interval", interval, *INTERVALS)
        seed = random.randrange(2**32) if seed is None else seed
        pushes = RandomPushes(strength, interval, seed) if strength else None
        return self._request(Control.push_at_random, pushes)

    def save(self, is_before_reset: bool = False) -> Iterator[PackedSegment]:
        """The last minute since the last reset, or of the walk before it, as it comes from the control process.

        It is requested at once; to go on with the iterator waits. To unpack the segments is work for a process that has
        the time. Nothing here keeps them, which would be 30 MB.

        Raises:
            NothingToSaveError: from the iterator, if there was no walk before.
            NoResponseError: from the iterator, if the control process does not respond.
        """
        items = SimpleQueue[PackedSegment | Future[Any]]()
        response = self._request(Control.save, is_before_reset, take_item=items.put)
        response.add_done_callback(items.put)
        return _until_done(items)

    def check_fork(self, fork: Fork) -> None:
        """Check what is to be different in a fork.

        Raises:
            InvalidValueError: if its reference or its push is beyond a limit.
        """
        if fork.reference is not None:
            self.robot.check_reference(fork.reference)
        if fork.push is not None:
            self._checked_push(fork.push)

    def fork(self, fork: Fork, segments: Path | None = None) -> Future[Parameters]:
        """Go on from an earlier tick; fails with a `WalkError`, and changes nothing.

        Args:
            fork: the tick, and what is to be different.
            segments: file with another walk of this robot, see `Control.fork`; None for the present walk.

        Raises:
            InvalidValueError: if its reference or its push is beyond a limit.
        """
        self.check_fork(fork)
        return self._request(Control.fork, fork, segments)

    def _request(self, method: Callable[..., Any], *arguments: Any, take_item: TakeItem = None) -> Future[Any]:
        self._attend()
        try:
            response = self._supervisor.link.request(method, *arguments, take_item=take_item)
        except NoResponseError as error:
            response = Future[Any]()
            response.set_exception(error)
        if method in BEGINNINGS and not (response.done() and response.exception()):
            self._command = NO_REFERENCE  # where it is refused, the reference still holds
            response.add_done_callback(self._note_beginning)
        return response

    def _note_beginning(self, done: Future[Any]) -> None:
        if self._is_started and not done.cancelled() and done.exception() is None:
            self.is_first_walk = False


@lru_cache(maxsize=2)
def _with_rose(state: LiveState, rose: PushRose) -> LiveState:
    return replace(state, push_rose=rose)


def _until_done(items: SimpleQueue[PackedSegment | Future[Any]]) -> Iterator[PackedSegment]:
    """The items in front of a future, which may fail instead."""
    while not isinstance(item := items.get(), Future):
        yield item
    item.result()
