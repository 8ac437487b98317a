"""One walk of the live robot since it last began: whatever begins the robot anew makes another one."""

import logging
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.live.fork import Fork, ForkedWalk, restored
from app.live.live_state import LiveState
from app.live.messages import reason
from app.live.session_log import SessionLog, read_segments
from app.live.timeline import Marks, Timeline
from walkcore import Command, Parameters, Simulation, Snapshot
from walkcore.analysis.push_recovery import PushRecoveryMonitor, balance_state
from walkcore.analysis.twin import TwinMonitor
from walkcore.errors import InvalidValueError
from walkcore.mpc.balance_sets import BalanceSets
from walkcore.stages import CountedTime, Stages, TimeLeft, unlimited
from walkcore.state import SimulationState

logger = logging.getLogger(__name__)


class LiveWalk:
    """A simulation that goes on tick by tick, with its log, its marks, and what is told of it."""

    def __init__(
        self,
        simulation: Simulation,
        number: int = 0,
        plant_reason: str = "",
        log: SessionLog | None = None,
        marks: Marks | None = None,
        forked: ForkedWalk | None = None,
    ) -> None:
        """Begin before the first tick.

        Args:
            simulation: that goes on from here.
            number: of the walk.
            plant_reason: why its plant is the one that it is, as a sentence.
            log: with ticks that it goes on from, where there are any.
            marks: of those ticks.
            forked: an earlier walk, beside which it goes on.
        """
        simulation.keep_twin_ready()
        self.simulation, self.number, self.plant_reason, self.forked = simulation, number, plant_reason, forked
        self.log, self._marks = log or SessionLog(simulation), marks or Marks()
        self._recovery, self._twin = forked.monitor if forked else PushRecoveryMonitor(), TwinMonitor()

    @property
    def parameters(self) -> Parameters:
        """The parameters in force."""
        return self.simulation.parameters

    def fork(self, fork: Fork, segments: Path | None, stages: Stages) -> "LiveWalk":
        """Another walk, which goes on from an earlier tick of this one, or of a recorded one; this one stays as it is.

        Args:
            fork: the tick, and what is to be different.
            segments: file of a recorded walk of this robot that holds the tick; None for this walk.
            stages: of the other walk's simulation.

        Raises:
            WalkError: if that cannot be.
        """
        kept = self.log.kept() if segments is None else list(read_segments(segments))
        simulation = restored(self.simulation.robot, kept, fork.tick, stages)
        if (period := simulation.parameters.control_period) != self.parameters.control_period:
            limit = f"must be {self.parameters.control_period:g} s, as that of the robot that walks"
            raise InvalidValueError("control_period", period, limit)
        base = self.parameters if fork.has_present_parameters else simulation.parameters
        simulation.change(base.changed(fork.parameters))
        return LiveWalk(
            simulation,
            self.number + 1,
            self.plant_reason if segments is None else "as in the recorded walk",
            SessionLog(simulation, kept, fork.tick),
            (self._marks if segments is None else Marks()).forked(fork.tick),
            ForkedWalk(fork, kept, simulation.robot, simulation.parameters),
        )

    def restore(self, state: SimulationState | None) -> bool:
        """Go on from a state that another process left; where no tick follows it, stand at rest and return False."""
        try:
            if state is not None:
                self.simulation.restore(state)
                self.simulation.preview(Command())
                return True
        except Exception as error:
            logger.warning("the walk cannot go on (%s): the robot stands at rest", reason(error))
        self.simulation.reset()
        return False

    def step(self, command: Command, time_left: TimeLeft = unlimited) -> Snapshot:
        """Take the next tick.

        Args:
            command: of the tick.
            time_left: for its decision; a walk that comes again has the time that it had.
        """
        counted = CountedTime(time_left if self.forked is None else self.forked.time_left(time_left))
        self.log.begin()
        snapshot = self.simulation.step(command, counted)
        self.log.end(command, snapshot, counted.solves_in_time)
        self._recovery.update(balance_state(snapshot, self.simulation.robot.mass))
        self._twin.update(snapshot)
        self._marks.update(command, snapshot)
        if self.forked is not None:
            self.forked.update(snapshot)
        return snapshot

    def change(self, values: Mapping[str, Any], sets: BalanceSets | None) -> None:
        """Go on with some parameters changed.

        Args:
            values: of parameters by name.
            sets: of `Simulation.change`.

        Raises:
            WalkError: if that cannot be; nothing has changed then.
        """
        before, after = self.parameters, self.parameters.changed(values)
        if after == before:
            return
        self.simulation.change(after, sets)
        self._marks.change(self.next_tick, before, after)

    def told_in(self, state: LiveState) -> LiveState:
        """A live state with all that is to be told of this walk after its latest tick, but for the snapshot."""
        return replace(
            state,
            next_state=self.simulation.state,
            plant=self.parameters.plant,
            plant_reason=self.plant_reason,
            world=self.simulation.world,
            walk=self.number,
            last_push=self._recovery.last,
            twin_difference=self._twin.difference,
            comparison=None if self.forked is None else self.forked.comparison,
            was=None if self.forked is None else self.forked.was,
        )

    @property
    def next_tick(self) -> int:
        """Number of the coming tick."""
        return self.simulation.state.model.tick

    def repeats_itself(self, snapshot: Snapshot) -> bool:
        """Whether the coming ticks would be like the latest, if no command came."""
        return snapshot.is_at_rest and self.forked is None and not self.simulation.state.pushes

    def timeline(self) -> Timeline:
        """The ticks that are kept, and what happened at them."""
        first, last = self.log.first_tick, self.next_tick - 1
        return Timeline(self.number, first, last, self.parameters.control_period, self._marks.since(first))
