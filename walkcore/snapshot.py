"""The snapshot of one tick, for viewers, streams, recorders and checks."""

import math
from dataclasses import dataclass

from walkcore.command import Reference
from walkcore.motion.swing_foot import FootState
from walkcore.mpc.gait import Phase
from walkcore.mpc.lipm import CoMState, Pendulum
from walkcore.mpc.plan import Plan, Status
from walkcore.mpc.stance import Footstep, Side, Stance
from walkcore.plant.fall_watch import NeededStep
from walkcore.plant.plant import GroundContact, Measurement
from walkcore.pushes import GivenPush
from walkcore.values import Vector

RESTING_SPEED = 1e-3  # [m/s] of the CoM of a robot at rest, at most
RESTING_DISTANCE = 1e-3  # [m] between its CoP and its DCM, at most: apart they drive each other on


@dataclass(frozen=True, slots=True, eq=False)
class PlantTick:
    """The plant at one tick, where it is not the ideal one."""

    measured: Measurement
    """The body as it is."""
    contact: GroundContact
    dcm_error: Vector
    """DCM of the body against the model's, as the stabiliser sees it [m], shape (2,)."""
    q_commanded: Vector
    """Configuration that is commanded, in Pinocchio's order, shape (nq,)."""
    caught_up: Vector
    """Velocity that the model has taken over from the body at this tick [m/s], shape (2,)."""
    commanded_cop: Vector | None = None
    """CoP that the joint torques are to produce, world frame [m], shape (2,); None of a body that has fallen."""


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """One tick, in the world frame: the state that the QP saw, and its decision."""

    tick: int
    t: float
    """[s]."""
    com: CoMState
    pendulum: Pendulum
    """The model that the CoM follows: its height, and omega."""
    jerk: Vector
    """Jerk of the CoM over the coming tick [m/s^3], shape (2,)."""
    cop: Vector
    """Centre of pressure of the model [m], shape (2,)."""
    true_cop: Vector | None
    """Centre of pressure from the full inverse dynamics [m], shape (2,); None for a robot without a body."""
    torques: Vector | None
    """Joint torques, of that inverse dynamics or measured in physics [N m], shape (nv - 6,); None without a body."""
    reference: Reference
    heading: float
    """Heading of the robot [rad]."""
    phase: Phase
    support: Footstep
    """The foot that the QP holds fixed."""
    stance: Stance
    """The foot, or both feet, on the ground."""
    samples_on_support: int
    """Samples of the horizon that the support foot carries alone."""
    time_to_touchdown: float
    """[s]."""
    step_duration: float
    """Duration of the step under way, or the first one to come [s]."""
    next_step_duration: float
    """Duration of the steps after it [s]."""
    steps_to_stand: int
    """Touchdowns until the feet stand side by side: 0 while they do for good, -1 if the walk goes on."""
    left_foot: FootState
    right_foot: FootState
    push: Vector
    """Impulse given at this tick [N s], shape (2,)."""
    last_push: GivenPush | None
    """The latest push; None before the first one."""
    status: Status
    reason: str
    """Why the robot fell, or that the last plan goes on; empty otherwise."""
    plan: Plan | None
    """None once the robot has fallen."""
    com_offset: Vector
    """Offset of the body's CoM from the model's, where the dynamic filter moves it [m], shape (2,)."""
    q: Vector | None
    """Configuration of the body as it is, in Pinocchio's order, shape (nq,); None for a robot without a body."""
    plant: PlantTick | None
    """None for the ideal plant."""
    needed_step: NeededStep | None = None
    """Step out of reach that would have stopped a robot which has fallen; None where that was another limit."""
    twin: "Snapshot | None" = None
    """The ideal plant on the same commands, where one walks beside this one."""

    @property
    def is_at_rest(self) -> bool:
        """Whether the robot stands for good, is to stand, and hardly moves."""
        return (
            self.reference.is_zero
            and self.status is Status.SOLVED
            and self.phase is Phase.STANDING
            and self.steps_to_stand == 0
            and math.dist(self.com.velocity.tolist(), (0.0, 0.0)) < RESTING_SPEED
            and math.dist(self.dcm.tolist(), self.cop.tolist()) < RESTING_DISTANCE
        )

    @property
    def com_height(self) -> float:
        """Height of the CoM above the ground [m]."""
        return self.pendulum.height

    @property
    def dcm(self) -> Vector:
        """Divergent component of motion c + dc/omega [m], shape (2,)."""
        return self.pendulum.dcm(self.com)

    @property
    def feet(self) -> dict[Side, FootState]:
        """Both feet by their sides."""
        return {Side.LEFT: self.left_foot, Side.RIGHT: self.right_foot}
