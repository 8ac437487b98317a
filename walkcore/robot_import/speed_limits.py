# pyright: basic, reportMissingImports=false
# (Pinocchio ships no types)
"""The fastest feet and references of a robot within the speed limits of its joints.

Feet: with the Jacobian J of a leg from its hip to its sole, joints that turn at u move the sole along one direction e
alone if J u = e v; the fastest v has the first joint at its limit. The least of a stride counts.

References: found by short walks in the ideal model. Each direction starts from its limit in the robot file, and goes
down until a walk keeps the promises of one: it does not fall, soles and CoM are within a millimetre of their targets,
and no joint turns faster than its limit.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from walkcore.command import Command, Reference
from walkcore.motion.swing_foot import FootState, standing
from walkcore.motion.whole_body import BodyTarget, WholeBody
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Footstep, Side
from walkcore.robot import Robot
from walkcore.simulation import Simulation
from walkcore.values import Matrix, Vector

PERIOD = 0.01  # [s] of a tick: joint speeds are means over it
NB_STEPS = 6  # of a walk: from rest to the speed that it keeps
SLOWER = 0.85  # from one try to the next
NB_TRIES = 12  # down to a sixth
MAX_IK_ERROR = 1e-3  # [m]
NB_PLACES = 3  # of the foot along a stride, on the ground and in the air
USED = 0.9  # of the speed that the joints allow the foot: the rest lifts it
FORWARD, SIDEWAYS, YAW = 0, 1, 5  # rows of a Jacobian


@dataclass(frozen=True, slots=True)
class FootSpeeds:
    """The fastest that the joints of a leg move its sole along one direction, at the slowest place of a stride."""

    forward: float
    """[m/s]."""
    sideways: float
    """[m/s]."""
    yaw_rate: float
    """[rad/s]."""
    joint: str
    """Joint of the leg that is at its limit first, forward."""


def foot_speeds(robot: Robot) -> FootSpeeds | None:
    """The fastest that the legs move their soles against the pelvis; None where a joint of a leg has no speed limit.

    Args:
        robot: with a body that stands at its CoM height.

    Raises:
        InverseKinematicsError: if a stride at the fastest reference is too long for its legs.
    """
    assert robot.body is not None
    body, stride = WholeBody(robot.body), robot.max_reference["vx"][1] * robot.parameters.step_duration
    model = body.model
    frames = {side: model.getFrameId(robot.body.sole(side)) for side in Side}
    supports = {side: list(model.supports[model.frames[frame].parentJoint]) for side, frame in frames.items()}
    least, first = np.full(6, np.inf), ""
    for side in Side:
        joints = [model.joints[joint] for joint in supports[side] if joint not in supports[side.other]]
        columns = [joint.idx_v for joint in joints]
        limits = model.velocityLimit[columns]
        if not np.all((limits > 0.0) & (limits < np.inf)):
            return None
        for q in _strides(robot, body, side, stride):
            jacobian = _jacobian(model, q, frames[side])[:, columns]
            uses = np.abs(np.linalg.pinv(jacobian)) / limits[:, None]  # of the limits at 1 m/s or rad/s
            speeds = 1.0 / np.max(uses, axis=0)
            if speeds[FORWARD] < least[FORWARD]:
                first = model.names[joints[int(np.argmax(uses[:, FORWARD]))].id]
            least = np.minimum(least, speeds)
    return FootSpeeds(float(least[FORWARD]), float(least[SIDEWAYS]), float(least[YAW]), first)


def _strides(robot: Robot, body: WholeBody, side: Side, stride: float) -> Iterator[Vector]:
    """Configurations with one foot on the ground and the other along its way, shape (nq,)."""
    other = standing(robot.foot_at_rest(side.other))
    for ahead in np.linspace(-stride, stride, NB_PLACES):
        place = robot.foot_at_rest(side).position + [ahead, 0.0]
        for height in (0.0, robot.parameters.swing_height):
            foot = FootState(standing(Footstep(side, place, 0.0)).matrix, height)
            left, right = (foot, other) if side is Side.LEFT else (other, foot)
            yield body.at_rest(BodyTarget(np.array([ahead / 2, 0.0, robot.com_height]), left, right, heading=0.0))


def _jacobian(model: pin.Model, q: Vector, frame: int) -> Matrix:
    data = model.createData()
    return pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)


def keeps_limits(robot: Robot, reference: Reference) -> bool:
    """Whether the robot walks with a reference within the limits of its joints.

    Args:
        robot: with a body.
        reference: from rest on.
    """
    p = replace(robot.parameters, control_period=PERIOD, dynamic_filter=True)
    simulation, q = Simulation(robot, p), None
    body = simulation.body
    assert body is not None
    for _ in range(round(NB_STEPS * p.step_duration / PERIOD)):
        now = simulation.step(Command(reference))
        if now.status is Status.FALLEN or now.q is None:
            return False
        com = np.array([*(now.com.position + now.com_offset), now.com_height])
        if max(body.errors(now.q, com, now.feet)) > MAX_IK_ERROR:
            return False
        if q is not None and np.any(np.abs(now.q - q)[7:] > body.max_speeds * PERIOD):
            return False
        q = now.q
    return True


def fastest_references(robot: Robot) -> Iterator[tuple[str, tuple[float, float]]]:
    """Lowest and highest reference of each component that the robot keeps, none beyond those of its file.

    Zero where not even a sixth of the file's is kept.

    Args:
        robot: with a body.
    """
    for name, (low, high) in robot.max_reference.items():
        yield name, (_kept(robot, name, low), _kept(robot, name, high))


def _kept(robot: Robot, name: str, limit: float) -> float:
    tries = (round(limit * SLOWER**step, 3) for step in range(NB_TRIES))
    return next((value for value in tries if keeps_limits(robot, Reference(**{name: value}))), 0.0)
