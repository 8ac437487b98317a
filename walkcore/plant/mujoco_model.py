# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false
# (Pinocchio and MuJoCo ship no types that hold)
"""The MuJoCo model of a robot, made from its Pinocchio model: nothing is read twice, and no file is changed.

A body for each joint with its inertia, a servo for each hinge, a plate for each sole. The links get shells, capsules
from each joint to those that it carries, which touch the ground and nothing else: for a robot that has fallen.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin

from walkcore.errors import InvalidValueError
from walkcore.mpc.stance import Side, on_side
from walkcore.plant.world import STRIP_SPACING, STRIP_WIDTH, World
from walkcore.robot import Robot
from walkcore.values import Matrix, Vector

PHYSICS_PERIOD = 1e-3  # [s]: at 2.5 ms the contact CoP is 17 cm off, at 4 ms the robot falls
SOLE_THICKNESS = 0.02  # [m]
SHELL_RADIUS = 0.05  # [m] of the capsules around the links
NB_STRIPS = 60  # to either side of the origin
STRIP_LENGTH = 60.0  # [m]
GROUND, ROBOT = 1, 2  # bits of what collides with what
STIFF, ANKLE, ARM = (44.0, 2.2), (7.3, 0.44), (7.3, 0.29)  # gains of servos [1/s^2, 1/s], times the robot's inertia
FREE_FLYER = 7  # numbers of the floating base in a configuration
EFFORT_OF_BASE = 6  # velocities of the floating base


@dataclass(frozen=True, slots=True)
class Servo:
    """Position servo of a joint: torque = kp (reference - angle) - kd velocity."""

    kp: float
    """[N m/rad]."""
    kd: float
    """[N m s/rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class MujocoModel:
    """A compiled model, and what its numbers stand for."""

    model: mujoco.MjModel
    servos: Matrix
    """kp and kd of each joint in Pinocchio's order, shape (nv - 6, 2)."""
    soles: Mapping[Side, int]
    """Sites at the sole frames."""
    feet: Mapping[Side, int]
    """Bodies that carry the soles."""
    torso: int
    """Body that is pushed where no other is named."""


def build(robot: Robot, pinocchio: pin.Model, world: World, gravity: float) -> MujocoModel:
    """Build and compile the model.

    Args:
        robot: with a body.
        pinocchio: model of that body, with its free flyer.
        world: the ground, and what the robot carries.
        gravity: magnitude of its acceleration [m/s^2].

    Raises:
        InvalidValueError: if a body is none that physics knows, such as for its inertia.
    """
    assert robot.body is not None
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = PHYSICS_PERIOD
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.gravity = world.gravity(gravity)
    _add_ground(spec, world)
    bodies = {0: spec.worldbody}
    for joint in range(1, pinocchio.njoints):
        bodies[joint] = _add_body(bodies[pinocchio.parents[joint]], pinocchio, joint, 1.0 + world.mass_error)
    for joint in range(2, pinocchio.njoints):
        parent = pinocchio.parents[joint]
        if parent:
            _add_shell(bodies[parent], np.array(pinocchio.jointPlacements[joint].translation))
    frames = {side: pinocchio.frames[pinocchio.getFrameId(robot.body.sole(side))] for side in Side}
    for side, frame in frames.items():
        _add_sole(spec, bodies[frame.parentJoint], side, frame.placement, robot.sole, world.friction)
    gains = _gains(robot, pinocchio)
    for joint in range(2, pinocchio.njoints):
        effort = float(pinocchio.effortLimit[pinocchio.joints[joint].idx_v])
        actuator = spec.add_actuator(
            name=pinocchio.names[joint], target=pinocchio.names[joint], trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        actuator.set_to_position(kp=gains[joint].kp, kv=gains[joint].kd)
        actuator.forcerange = [-effort, effort]
        actuator.forcelimited = True
    torso = _torso(robot, pinocchio)
    bodies[torso].mass += world.payload
    try:
        model = spec.compile()
    except ValueError as error:  # such as an inertia that no body has
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise InvalidValueError("robot.body.urdf", robot.name, f"cannot be simulated in physics: {reason}") from error
    return MujocoModel(
        model=model,
        servos=np.array([[gains[joint].kp, gains[joint].kd] for joint in range(2, pinocchio.njoints)]),
        soles={side: _id(model, mujoco.mjtObj.mjOBJ_SITE, side.name) for side in Side},
        feet={side: _id(model, mujoco.mjtObj.mjOBJ_BODY, pinocchio.names[f.parentJoint]) for side, f in frames.items()},
        torso=_id(model, mujoco.mjtObj.mjOBJ_BODY, pinocchio.names[torso]),
    )


def _id(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> int:
    return mujoco.mj_name2id(model, kind, name)


def _add_ground(spec: mujoco.MjSpec, world: World) -> None:
    """An endless plane, and strips across it."""
    contact = {"friction": [world.friction, 0.005, 0.0001], "contype": GROUND, "conaffinity": ROBOT}
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0], **contact)
    if world.strip_height == 0.0:
        return
    for k in (n for n in range(-NB_STRIPS, NB_STRIPS + 1) if n != 0):
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[k * STRIP_SPACING, 0.0, 0.0],
            size=[STRIP_WIDTH / 2, STRIP_LENGTH / 2, world.strip_height],
            **contact,
        )


def _add_body(parent: mujoco.MjsBody, pinocchio: pin.Model, joint: int, heavier: float) -> mujoco.MjsBody:
    placement, inertia, kind = pinocchio.jointPlacements[joint], pinocchio.inertias[joint], pinocchio.joints[joint]
    name = pinocchio.names[joint]
    body = parent.add_body(name=name, pos=placement.translation, quat=_wxyz(placement.rotation))
    I = heavier * inertia.inertia  # noqa: E741 (the letter of the field)
    body.mass, body.ipos, body.explicitinertial = heavier * inertia.mass, inertia.lever, True
    body.fullinertia = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
    if kind.nq == FREE_FLYER:
        body.add_freejoint(name=name)
        return body
    data = kind.createData()
    kind.calc(data, pin.neutral(pinocchio))
    limits = [pinocchio.lowerPositionLimit[kind.idx_q], pinocchio.upperPositionLimit[kind.idx_q]]
    body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=np.ravel(data.S)[3:], range=limits, limited=True)
    return body


def _add_shell(body: mujoco.MjsBody, end: Vector) -> None:
    """A capsule from the origin of a body to a joint that it carries."""
    if np.linalg.norm(end) < 0.05:
        return
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[0.0, 0.0, 0.0, *end],
        size=[SHELL_RADIUS, 0.0, 0.0],
        mass=0.0,
        contype=ROBOT,
        conaffinity=GROUND,
    )


def _add_sole(
    spec: mujoco.MjSpec, foot: mujoco.MjsBody, side: Side, placement: pin.SE3, sole: Matrix, friction: float
) -> None:
    """A plate whose lower face is the outline of a sole, and a site at the sole frame."""
    outline = on_side(side, sole)
    low, high = outline.min(axis=0), outline.max(axis=0)
    foot.add_site(name=side.name, pos=placement.translation, quat=_wxyz(placement.rotation))
    contact = {"friction": [friction, 0.005, 0.0001], "contype": ROBOT, "conaffinity": GROUND, "mass": 0.0}
    if len(outline) == 4 and np.all(np.isclose(outline, low) | np.isclose(outline, high)):  # a rectangle
        centre = placement.act(np.array([*(low + high) / 2, SOLE_THICKNESS / 2]))
        size = [*(high - low) / 2, SOLE_THICKNESS / 2]
        foot.add_geom(
            name=f"{side.name} sole", type=mujoco.mjtGeom.mjGEOM_BOX, size=size, pos=centre,
            quat=_wxyz(placement.rotation), **contact,
        )  # fmt: skip
        return
    vertices = [[*corner, z] for z in (0.0, SOLE_THICKNESS) for corner in outline]
    spec.add_mesh(name=f"{side.name} sole", uservert=np.ravel(vertices))
    foot.add_geom(
        name=f"{side.name} sole", type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"{side.name} sole",
        pos=placement.translation, quat=_wxyz(placement.rotation), **contact,
    )  # fmt: skip


def _torso(robot: Robot, pinocchio: pin.Model) -> int:
    """Joint that moves the torso."""
    assert robot.body is not None
    return pinocchio.frames[pinocchio.getFrameId(robot.body.torso)].parentJoint


def _gains(robot: Robot, pinocchio: pin.Model) -> dict[int, Servo]:
    """Servo of each joint: stiff legs and torso, ankles that give way, light arms.

    In proportion to the inertia m h^2 of the whole robot about its feet, so that robots of other sizes swing alike.
    """
    assert robot.body is not None
    inertia = robot.mass * robot.com_height**2
    stiff, ankle, arm = (Servo(kp * inertia, kd * inertia) for kp, kd in (STIFF, ANKLE, ARM))
    gains = {joint: arm for joint in range(2, pinocchio.njoints)}
    torso = _torso(robot, pinocchio)
    for joint in list(pinocchio.supports[torso])[2:]:
        gains[joint] = stiff
    for side in Side:
        foot = pinocchio.frames[pinocchio.getFrameId(robot.body.sole(side))].parentJoint
        leg = list(pinocchio.supports[foot])[2:]
        for joint in leg[:-2]:
            gains[joint] = stiff
        for joint in leg[-2:]:
            gains[joint] = ankle
    return gains


def _wxyz(rotation: Matrix) -> list[float]:
    quaternion = pin.Quaternion(rotation)
    return [quaternion.w, quaternion.x, quaternion.y, quaternion.z]
