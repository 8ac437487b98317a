"""The rose of pushes of the live walk, computed over and over in a process of its own while somebody looks at it.

A rose costs some hundred ticks, so it is none of the control process's work: a process behind all others is sent the
latest state, from which it can go on as the control process would, and a point mass with the same decisions answers.
"""

import logging
import pickle
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

from app.jobs import JobRunner, Report
from app.live.live_state import LiveState
from walkcore import Parameters, Reference, Robot, Simulation
from walkcore.analysis.push_rose import PushRose, push_rose
from walkcore.state import SimulationState

logger = logging.getLogger(__name__)

NICENESS = 5  # of 19: behind the walk and the page; further behind, a browser that renders in software would starve it
PERIOD = 0.25  # [s] from one rose to the next, at least
SHARE = 0.7  # of a core that the process may take
KEPT_FOR = 1.0  # [s] after the last request for which roses go on
IDLE_TIMEOUT = 10.0  # [s] without a request after which the process is ended, for its memory


@dataclass(frozen=True, slots=True, eq=False)
class PushRoseJob:
    """Job of a process: the rose of one state."""

    robot: bytes
    """Pickled point mass, so that the same one is recognised."""
    parameters: Parameters
    state: SimulationState
    reference: Reference

    def __call__(self, _: Report) -> PushRose | None:
        """Compute it."""
        simulation = _simulation(self.robot, self.parameters)
        simulation.restore(self.state)
        return push_rose(simulation, self.reference)


@lru_cache(maxsize=1)
def _simulation(robot: bytes, parameters: Parameters) -> Simulation:
    return Simulation(pickle.loads(robot), parameters)


class PushRoses:
    """The latest rose of a robot that walks, as long as somebody asks for it. Any thread may ask and read."""

    def __init__(self, robot: Robot, state: Callable[[], LiveState], parameters: Callable[[], Parameters]) -> None:
        """Compute nothing yet.

        Args:
            robot: that walks.
            state: gives its latest state.
            parameters: gives those in force.
        """
        self._robot = pickle.dumps(replace(robot, body=None))
        self._state, self._parameters = state, parameters
        self._jobs = JobRunner(NICENESS)
        self._requested_at = float("-inf")
        self._wake = threading.Condition()
        self._thread: threading.Thread | None = None
        self._latest: PushRose | None = None

    @property
    def latest(self) -> PushRose | None:
        """The latest rose; None while nobody asks for one, before the first one, and of a robot that lies."""
        return self._latest if self._is_requested(KEPT_FOR) else None

    def request(self) -> None:
        """Ask for roses for the next second; costs nothing where they are computed already."""
        with self._wake:
            was_requested, self._requested_at = self._is_requested(KEPT_FOR), time.monotonic()
            if self._jobs.is_stopping:
                return
            if self._thread is None:
                self._thread = threading.Thread(target=self._serve, name="push roses", daemon=True)
                self._thread.start()
            elif not was_requested:
                self._latest = None
                self._wake.notify()

    def stop(self) -> None:
        """End the process."""
        self._jobs.stop()
        with self._wake:
            self._wake.notify()
        if self._thread is not None:
            self._thread.join()

    def _is_requested(self, within: float) -> bool:
        return time.monotonic() - self._requested_at < within

    def _serve(self) -> None:
        before: object = None
        has_failed = False
        while self._wait_for_request():
            started, state, parameters = time.monotonic(), self._state(), self._parameters()
            present = state.walk, state.snapshot.tick, parameters
            if present != before or self._latest is None:
                try:
                    self._latest = self._rose(state, parameters)
                    has_failed = False
                except Exception:
                    self._latest = None
                    if not (has_failed or self._jobs.is_stopping):  # once, not several times a second
                        logger.exception("no rose of pushes")
                    has_failed = True
                before = present
            spent = time.monotonic() - started
            with self._wake:
                if not self._jobs.is_stopping:
                    self._wake.wait(max(PERIOD - spent, spent / SHARE - spent))

    def _wait_for_request(self) -> bool:
        """Wait until roses are asked for; False when there are to be no more."""
        timeout: float | None = IDLE_TIMEOUT
        with self._wake:
            while not self._jobs.is_stopping and not self._is_requested(KEPT_FOR):
                self._latest = None
                if not self._wake.wait(timeout):
                    self._jobs.end_process()
                    timeout = None
            return not self._jobs.is_stopping

    def _rose(self, state: LiveState, parameters: Parameters) -> PushRose | None:
        if state.next_state is None or state.next_state.why_fallen:
            return None
        job = PushRoseJob(
            self._robot,
            replace(parameters, plant="ideal", twin=False),
            replace(state.next_state, driver=None, twin=None),
            state.snapshot.reference,
        )
        return self._jobs.run_and_keep(job).result()
