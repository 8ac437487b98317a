"""Changes of parameters, prepared beside the control loop, so that no tick waits for them however many come.

A change is checked and its slow part, the capturable sets, computed in a thread of the server. Changes that come
together are made as one, and no more than one in `CHANGE_PERIOD`; what has waited too long is dropped.
"""

import pickle
import threading
import time
from collections import deque
from collections.abc import Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from typing import Any

from app.live.control import Control
from app.live.link import EXPIRY
from app.live.messages import NoResponseError
from app.live.supervisor import Supervisor
from walkcore import Parameters, Robot, WalkError
from walkcore.mpc.balance_sets import balance_sets
from walkcore.mpc.supports import inner_soles

CHANGE_PERIOD = 0.2  # [s] between two changes, at least
PART = 16 * 1024  # bytes of the prepared sets in one message
MAX_WAITING = 64  # changes that wait for the next one
RESPONSE_TIMEOUT = 30.0  # [s] for the control process to make a change it has taken


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """A change that waits, and the promise of the parameters that it leads to."""

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
        self._tokens = count(1)
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
            self._make(batch)
            self._is_stopped.wait(CHANGE_PERIOD)
        for change in self._waiting:
            if change.response.set_running_or_notify_cancel():
                change.response.set_exception(NoResponseError("the server stops"))

    def _make(self, batch: list[Change]) -> None:
        """Make changes as one; one by one where that cannot be."""
        wanted = [change for change in batch if self._is_wanted(change)]
        merged, possible = self._supervisor.parameters, list[Change]()
        for change in wanted:
            try:
                merged = self._checked(merged, change.values)
                possible.append(change)
            except WalkError as refusal:
                change.response.set_exception(refusal)
        try:
            self._walk_on_with(merged)
        except Exception as failure:
            if len(possible) == 1 or not isinstance(failure, WalkError):
                for change in possible:
                    change.response.set_exception(failure)
                return
            for change in possible:
                self._make_alone(change)
            return
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

    def _make_alone(self, change: Change) -> None:
        try:
            self._walk_on_with(self._supervisor.parameters.changed(change.values))
            change.response.set_result(self._supervisor.parameters)
        except Exception as failure:
            change.response.set_exception(failure)

    def _is_wanted(self, change: Change) -> bool:
        """Whether somebody still waits for a change, which is begun then."""
        if not change.response.set_running_or_notify_cancel():
            return False
        if time.monotonic() > change.expires_at:
            change.response.set_exception(NoResponseError("the change has waited too long; try again"))
            return False
        return True

    def _walk_on_with(self, parameters: Parameters) -> None:
        """Prepare parameters and let the control process take them.

        Raises:
            WalkError: if the robot cannot walk with them.
            NoResponseError: if the control process does not respond.
        """
        if parameters == self._supervisor.parameters:
            return
        parts, token = sets_in_parts(self._robot, parameters), next(self._tokens)
        link = self._supervisor.link
        for part in parts:  # each is a message; where one is lost, all is only computed again
            link.request(Control.prepare, token, part)
        request = link.request(Control.change, parameters.to_mapping(), token, len(parts))
        with suppress(TimeoutError):
            self._supervisor.parameters = request.result(RESPONSE_TIMEOUT)
            return
        raise NoResponseError("the control process does not make the change")


def sets_in_parts(robot: Robot, parameters: Parameters) -> list[bytes]:
    """The pickled `BalanceSets` of a robot with some parameters, in parts of one message each, for `Control.prepare`.

    Raises:
        EmptyRegionError: if the CoP margin leaves nothing of a sole.
    """
    data = pickle.dumps(balance_sets(robot, parameters), pickle.HIGHEST_PROTOCOL)
    return [data[start : start + PART] for start in range(0, len(data), PART)]
