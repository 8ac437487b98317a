"""Changes of parameters, prepared beside the control loop, so that no tick waits for them however many come.

A change is checked and its slow part, the capturable sets, computed in a thread of the server. Changes that come
together are made as one, and no more than one in `CHANGE_PERIOD`; what has waited too long is dropped.
"""

import pickle
import threading
import time
import zlib
from collections import deque
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from app.live.control import Control
from app.live.link import EXPIRY
from app.live.messages import NoResponseError
from app.live.supervisor import Supervisor
from walkcore import Parameters, Robot, WalkError
from walkcore.mpc.balance_sets import balance_sets
from walkcore.mpc.supports import inner_soles

CHANGE_PERIOD = 0.2  # [s] between two changes, at least
MAX_SETS = 100 * 1024  # bytes of the packed sets, which go by one message: Talos needs 22 kB, and 41 kB at most
MAX_WAITING = 64  # changes that wait for the next one
RESPONSE_TIMEOUT = 30.0  # [s] for the control process to make a change it has taken


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """A change that waits, and the future of the parameters that it leads to."""

    values: Mapping[str, Any]
    response: "Future[Parameters]"
    expires_at: float
    """Time on `time.monotonic` after which nobody waits for it any more [s]."""


class ParameterChanges:
    """Makes the changes of a robot's parameters, one after the other. All methods may be called from any thread."""

    def __init__(self, robot: Robot, supervisor: Supervisor) -> None:
        """Start the thread.

        Args:
            robot: that walks.
            supervisor: of its control process, which holds the parameters in force.
        """
        self._robot, self._supervisor = robot, supervisor
        self._waiting: deque[Change] = deque()
        self._has_news = threading.Condition()
        self._is_stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="parameter changes", daemon=True)
        self._thread.start()

    def request(self, values: Mapping[str, Any]) -> "Future[Parameters]":
        """Walk on with some parameters changed.

        Returns:
            All parameters; fails with a `WalkError`, and changes nothing, where that cannot be.
        """
        response: Future[Parameters] = Future()
        try:
            present = self._supervisor.parameters
            self._checked(present, values)  # nothing else travels or waits
            with self._has_news:
                if trouble := self._supervisor.trouble:
                    raise NoResponseError(trouble)
                if self._is_stopped.is_set() or len(self._waiting) >= MAX_WAITING:
                    raise NoResponseError("too many changes of parameters wait; try again")
                self._waiting.append(Change(dict(values), response, time.monotonic() + EXPIRY))
                self._has_news.notify()
        except (WalkError, NoResponseError) as refusal:
            response.set_exception(refusal)
        return response

    def stop(self) -> None:
        """End the thread; what waits fails."""
        self._is_stopped.set()
        with self._has_news:
            self._has_news.notify()
        self._thread.join()

    def _run(self) -> None:
        while not self._is_stopped.is_set():
            with self._has_news:
                self._has_news.wait_for(lambda: self._waiting or self._is_stopped.is_set())
                batch = list(self._waiting)
                self._waiting.clear()
            self._make([change for change in batch if _is_wanted(change)])
            self._is_stopped.wait(CHANGE_PERIOD)
        for change in self._waiting:
            if change.response.set_running_or_notify_cancel():
                change.response.set_exception(NoResponseError("the server stops"))

    def _make(self, changes: list[Change]) -> None:
        """Make changes as one; one by one where that cannot be."""
        merged, possible = self._supervisor.parameters, list[Change]()
        for change in changes:
            try:
                merged = self._checked(merged, change.values)
                possible.append(change)
            except WalkError as refusal:
                change.response.set_exception(refusal)
        try:
            self._walk_on_with(merged)
        except Exception as failure:
            for change in possible:
                if isinstance(failure, WalkError) and len(possible) > 1:
                    self._make([change])
                else:
                    change.response.set_exception(failure)
        else:
            for change in possible:
                change.response.set_result(self._supervisor.parameters)

    def _checked(self, before: Parameters, values: Mapping[str, Any]) -> Parameters:
        """The changed parameters.

        Raises:
            WalkError: if the robot cannot walk on with them; what takes long is not checked.
        """
        parameters = before.check_change(before.changed(values))
        inner_soles(self._robot, parameters.cop_margin)
        return parameters

    def _walk_on_with(self, parameters: Parameters) -> None:
        """Prepare parameters and let the control process take them.

        Raises:
            WalkError: if the robot cannot walk with them.
            NoResponseError: if the control process does not respond.
        """
        if parameters == self._supervisor.parameters:
            return
        sets = packed_sets(self._robot, parameters)
        if len(sets) > MAX_SETS:
            sets = b""  # the control process computes them
        request = self._supervisor.link.request(Control.change, parameters.to_mapping(), sets)
        try:
            request.result(RESPONSE_TIMEOUT)
        except TimeoutError:
            raise NoResponseError("the control process does not make the change") from None


def _is_wanted(change: Change) -> bool:
    """Whether somebody still waits for a change, which is begun then."""
    if not change.response.set_running_or_notify_cancel():
        return False
    if time.monotonic() > change.expires_at:
        change.response.set_exception(NoResponseError("the change has waited too long; try again"))
        return False
    return True


def packed_sets(robot: Robot, parameters: Parameters) -> bytes:
    """The pickled and compressed `BalanceSets` of a robot with some parameters, for `Control.change`.

    Raises:
        EmptyRegionError: if the CoP margin leaves nothing of a sole.
    """
    return zlib.compress(pickle.dumps(balance_sets(robot, parameters), pickle.HIGHEST_PROTOCOL), 1)
