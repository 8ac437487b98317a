"""The model of the robot at one tick: the CoM of its pendulum, its feet and its gait; and how they go on.

model = model.pushed(impulse / mass)       a push
model = model.with_gait(gait, apex)        the planner has decided when the step under way ends
model = motion.advance(model, plan)        the CoM moves by (2), the foot in the air towards its foothold
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from walkcore.motion.dynamic_filter import NO_OFFSET, Motion, Offset, dcm_offset
from walkcore.motion.swing_foot import Flight, FootState, bump_at, retimed_flight, standing, swing, swing_height
from walkcore.motion.whole_body import BodyTarget
from walkcore.mpc.gait import Gait, GaitState, Phase, Timing
from walkcore.mpc.lipm import CoMState, Pendulum
from walkcore.mpc.plan import Plan
from walkcore.mpc.stance import Footstep, Side, Stance
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.stages import Stages
from walkcore.values import Matrix, Vector


@dataclass(frozen=True, eq=False)  # no slots: what is derived is computed once
class ModelState:
    """The state of the model between two ticks, in the world frame."""

    tick: int
    """The coming tick."""
    gait: Gait
    flight: Flight | None
    """Height of the foot in the air, where its touchdown was moved."""
    left_foot: FootState
    right_foot: FootState
    com: CoMState
    com_offset: Offset
    """Offset of the body's CoM from the model's."""

    @cached_property
    def gait_state(self) -> GaitState:
        """The state of the gait at this tick."""
        return self.gait.at(self.tick)

    @property
    def feet(self) -> dict[Side, FootState]:
        """Both feet by their sides."""
        return {Side.LEFT: self.left_foot, Side.RIGHT: self.right_foot}

    @property
    def support_foot(self) -> FootState:
        """The foot that carries the robot; while standing, the one that will carry the first step."""
        return self._foot(self.gait_state.support_side)

    @property
    def swing_foot(self) -> FootState:
        """The other one."""
        return self._foot(self.gait_state.support_side.other)

    def _foot(self, side: Side) -> FootState:
        return self.left_foot if side is Side.LEFT else self.right_foot

    @property
    def heading(self) -> float:
        """Mean yaw of the feet [rad]."""
        return (self.left_foot.yaw + self.right_foot.yaw) / 2

    def footstep(self, side: Side) -> Footstep:
        """The place of a sole on the ground, or below the foot in the air."""
        return _footstep(side, self._foot(side))

    def stance(self, sole: Matrix) -> Stance:
        """The foot, or both feet, on the ground.

        Args:
            sole: outline of the left sole in its own frame [m], shape (V, 2).
        """
        side = self.gait_state.support_side
        support = self.footstep(side)
        is_alone = self.gait_state.phase is Phase.SINGLE_SUPPORT
        return Stance((support,) if is_alone else (support, self.footstep(side.other)), sole)

    def body_target(self, height: float) -> BodyTarget:
        """The target of the whole body at this tick.

        Args:
            height: of the CoM [m].
        """
        com = np.array([*(self.com.position + self.com_offset.position), height])
        return BodyTarget(com, self.left_foot, self.right_foot, self.heading)

    def pushed(self, velocity: Vector) -> "ModelState":
        """The state after a jump of the CoM's velocity [m/s], shape (2,)."""
        return replace(self, com=self.com.pushed(velocity))

    def with_gait(self, gait: Gait, apex: float) -> "ModelState":
        """The state with another gait, by whose touchdown the foot in the air comes to the ground.

        Args:
            gait: from this tick on.
            apex: highest point of a step of the usual duration [m].
        """
        return self if gait is self.gait else replace(self, gait=gait, flight=self._retimed_flight(gait, apex))

    def _retimed_flight(self, gait: Gait, apex: float) -> Flight | None:
        tick, now, period = self.tick, self.gait_state, self.gait.timing.control_period
        (begin, touchdown), (_, new_touchdown) = self.gait.step_ticks(tick), gait.step_ticks(tick)
        if now.phase is not Phase.SINGLE_SUPPORT or new_touchdown == touchdown:
            return self.flight
        lift_off = begin + self.gait.timing.ticks_per_sample
        if self.flight is not None:
            height = self.flight.at(tick, period)
        else:
            height = bump_at(now.swing_progress, apex, (touchdown - lift_off) * period)
        new_apex = apex * (new_touchdown - lift_off) / (touchdown - lift_off)
        return retimed_flight(height, tick, new_touchdown, period, new_apex)

    def with_timing(self, timing: Timing) -> "ModelState":
        """The state with another timing of the gait; a step under way keeps its duration."""
        return replace(self, gait=self.gait.with_timing(timing, self.tick))

    def one_tick_later(self) -> "ModelState":
        """The state of a robot of which nothing moves, at the next tick: its gait waits."""
        return replace(self, tick=self.tick + 1, gait=self.gait.waiting(self.tick))

    def fallen(self) -> "ModelState":
        """The state of a robot that lies: nothing of it moves any longer."""
        return replace(self, flight=None, com=CoMState.at_rest(self.com.position))


def model_at_rest(robot: Robot, timing: Timing) -> ModelState:
    """The robot on both feet around the origin, at tick 0."""
    left, right = (standing(robot.foot_at_rest(side)) for side in Side)
    middle = np.mean([left.position, right.position], axis=0)
    return ModelState(0, Gait(timing), None, left, right, CoMState.at_rest(middle), NO_OFFSET)


class ModelMotion:
    """How the model goes on from one tick to the next, by its plan."""

    def __init__(self, robot: Robot, parameters: Parameters, pendulum: Pendulum, stages: Stages) -> None:
        """Take what stays the same from tick to tick.

        Args:
            robot: that moves.
            parameters: of the walk.
            pendulum: that its CoM follows.
            stages: get laps for the dynamic filter and for the swing foot.
        """
        self._robot, self._parameters, self._pendulum, self._stages = robot, parameters, pendulum, stages
        self._has_filter = parameters.dynamic_filter and robot.body is not None
        self._max_foot_speed = (*robot.max_foot_speed.tolist(), robot.max_foot_yaw_rate)

    def advance(self, model: ModelState, plan: Plan) -> ModelState:
        """The model at the next tick.

        Args:
            model: at this tick.
            plan: decided at it.
        """
        p, tick, gait = self._parameters, model.tick + 1, model.gait
        offset = model.com_offset
        if self._has_filter:
            offset = self._next_offset(model, plan)
            self._stages.lap("dynamic_filter")
        feet, flight = model.feet, model.flight
        if model.gait_state.phase is Phase.SINGLE_SUPPORT:
            feet[model.gait_state.support_side.other] = self._next_swing_foot(model, plan.footholds[0])
            flight = None if flight is not None and flight.touchdown == tick else flight
        com = model.com.integrated(plan.jerk, p.control_period)
        gait = Gait(p.timing, gait.support_side(tick)) if gait.has_ended(tick) else gait.at_next_step(p.timing, tick)
        self._stages.lap("swing_foot")
        return ModelState(tick, gait, flight, feet[Side.LEFT], feet[Side.RIGHT], com, offset)

    def _next_swing_foot(self, model: ModelState, foothold: Footstep) -> FootState:
        p, now = self._parameters, model.gait_state
        if model.flight is None:
            height = swing_height(now.next_swing_progress, p.swing_height)
        else:
            height, _, _ = model.flight.at(model.tick + 1, p.control_period)
        return swing(
            model.swing_foot,
            foothold,
            time_left=now.time_to_touchdown,
            tick=p.control_period,
            max_speed=self._max_foot_speed,
            support_yaw=model.support_foot.yaw,
            height=height,
        )

    def _next_offset(self, model: ModelState, plan: Plan) -> Offset:
        p, omega = self._parameters, self._pendulum.omega
        motion = Motion(
            p.sampling_period,
            *model.gait.step_durations(model.tick),
            model.gait_state.time_to_touchdown,
            p.swing_height,
            model.com,
            support=model.support_foot,
            swing=model.swing_foot,
            plan=plan,
        )
        dcm = dcm_offset(motion, self._robot.swing_moments, omega)
        return model.com_offset.towards(dcm, omega, p.control_period)


@lru_cache(maxsize=8)  # a tick reads its feet several times
def _footstep(side: Side, foot: FootState) -> Footstep:
    return Footstep(side, foot.position, foot.yaw)
