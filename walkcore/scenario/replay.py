"""Snapshots of a recording, for whoever draws it."""

import math
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import count, takewhile

import numpy as np

from walkcore.analysis.columns import points, push_rows
from walkcore.command import Reference
from walkcore.motion.swing_foot import FootState, standing
from walkcore.mpc.gait import Phase
from walkcore.mpc.lipm import CoMState, Pendulum
from walkcore.mpc.plan import NO_BOUNDS, Plan, Status
from walkcore.mpc.stance import Footstep, Side, Stance
from walkcore.plant.plant import GroundContact, Measurement, SolePose
from walkcore.pushes import GivenPush
from walkcore.scenario.recording import Recording
from walkcore.snapshot import PlantTick, Snapshot
from walkcore.values import Matrix, Vector, frozen_copy

COPS_OF_A_PLANT = ("ground_cop", "commanded_cop")
NO_VELOCITY = frozen_copy(np.zeros(2))


def replayed(recording: Recording, every: int) -> Iterator[Snapshot]:
    """One snapshot for every so many rows, the first one's to begin with.

    What a recording does not hold is missing: the plan ends with the coming tick but for its footholds, the foot in
    the air has no speed, and there are no torques. Of an ideal twin there are CoM, CoP, feet, joints and status.
    """
    pushes = deque(_pushes(recording))
    last_push: GivenPush | None = None
    for k in range(0, len(recording.rows), every):
        numbers = recording.rows[k]
        while pushes and pushes[0].tick <= numbers[0]:
            last_push = pushes.popleft()
        values = dict(zip(recording.columns, numbers.tolist(), strict=True))
        snapshot = _snapshot(values, last_push, recording)
        yield replace(snapshot, plant=_plant(values), twin=_twin(values, snapshot))


def _pushes(recording: Recording) -> Iterator[GivenPush]:
    tick, impulses = recording["tick"], points(recording, "push")
    period = float(recording.parameters["control_period"])
    for first, end in push_rows(recording):
        x, y = impulses[first:end].sum(axis=0).tolist()
        yield GivenPush(int(tick[first]), (x, y), 0.0 if end - first == 1 else (end - first) * period)


def _snapshot(values: Mapping[str, float], last_push: GivenPush | None, recording: Recording) -> Snapshot:
    v, status, phase, robot = (
        values,
        Status(int(values["status"])),
        Phase(int(values["phase"])),
        recording.scenario.robot,
    )
    com = CoMState(np.array([[v[f"com_{d}{axis}"] for axis in "xy"] for d in ("", "v", "a")]))
    pendulum = Pendulum(v["com_z"], float(recording.parameters["gravity"]))
    support = Footstep(Side(int(v["support_side"])), _pair(v, "support"), v["support_yaw"])
    feet = {side: _foot(v, side) for side in Side}
    other = Footstep(support.side.other, feet[support.side.other].position, feet[support.side.other].yaw)
    stance = Stance((support,) if phase is Phase.SINGLE_SUPPORT else (support, other), robot.sole)
    return Snapshot(
        tick=int(v["tick"]),
        t=v["t"],
        com=com,
        pendulum=pendulum,
        jerk=_pair(v, "jerk"),
        cop=_pair(v, "cop"),
        true_cop=None if math.isnan(v["true_cop_x"]) else _pair(v, "true_cop"),
        torques=None,
        reference=Reference(v["reference_vx"], v["reference_vy"], v["reference_yaw_rate"]),
        heading=(v["left_yaw"] + v["right_yaw"]) / 2,
        phase=phase,
        support=support,
        stance=stance,
        samples_on_support=int(v["samples_on_support"]),
        time_to_touchdown=v["time_to_touchdown"],
        step_duration=v["step_duration"],
        next_step_duration=v["next_step_duration"],
        steps_to_stand=int(v["steps_to_stand"]),
        left_foot=feet[Side.LEFT],
        right_foot=feet[Side.RIGHT],
        push=_pair(v, "push"),
        last_push=last_push,
        status=status,
        reason=recording.reason if status is Status.FALLEN else "",
        plan=None if status is Status.FALLEN else _plan(v, com, pendulum, stance, recording),
        com_offset=_pair(v, "com_offset"),
        q=_configuration(v, "q"),
        plant=None,
    )


def _plant(values: Mapping[str, float]) -> PlantTick | None:
    """The measured body, without what no column tells: torques, the tilt of torso and soles, vertical velocity."""
    v, q, q_commanded = values, _configuration(values, "q"), _configuration(values, "q_commanded")
    if q is None or q_commanded is None:
        return None
    soles: dict[Side, SolePose] = {}
    for side in Side:
        x, y, z, yaw = (v[f"measured_{side.name.lower()}_{c}"] for c in ("x", "y", "z", "yaw"))
        soles[side] = SolePose(np.array([x, y, z]), yaw, tilt=math.nan)
    measured = Measurement(
        com=frozen_copy([v[f"measured_com_{c}"] for c in "xyz"]),
        com_velocity=frozen_copy([v["measured_com_vx"], v["measured_com_vy"], math.nan]),
        soles=soles,
        q=q,
        tilt=math.nan,
        torques=frozen_copy(np.full(len(q) - 7, math.nan)),
    )
    forces = {side: v[f"{side.name.lower()}_force"] for side in Side}
    cop, commanded_cop = (None if math.isnan(v[f"{name}_x"]) else _pair(v, name) for name in COPS_OF_A_PLANT)
    contact = GroundContact(cop, forces, frozen_copy([math.nan, math.nan, sum(forces.values())]))
    return PlantTick(measured, contact, _pair(v, "dcm_error"), q_commanded, NO_VELOCITY, commanded_cop)


def _twin(values: Mapping[str, float], beside: Snapshot) -> Snapshot | None:
    """The ideal twin beside a robot, whose clock and commands it shares."""
    q = _configuration(values, "twin_q")
    if q is None:
        return None
    v = {name.removeprefix("twin_"): value for name, value in values.items() if name.startswith("twin_")}
    com = np.array(beside.com.matrix)
    com[0] = _pair(v, "com")
    return replace(
        beside,
        com=CoMState(com),
        cop=_pair(v, "cop"),
        left_foot=_foot(v, Side.LEFT),
        right_foot=_foot(v, Side.RIGHT),
        status=Status(int(v["status"])),
        reason="",
        q=q,
        plan=None,
        true_cop=None,
    )


def _configuration(values: Mapping[str, float], name: str) -> Vector | None:
    """A configuration in Pinocchio's order, shape (nq,); None where the row has none."""
    if math.isnan(values.get(f"{name}_0", math.nan)):
        return None
    return frozen_copy([values[f"{name}_{i}"] for i in takewhile(lambda i: f"{name}_{i}" in values, count())])


def _pair(values: Mapping[str, float], name: str) -> Vector:
    return frozen_copy([values[f"{name}_x"], values[f"{name}_y"]])


def _foot(values: Mapping[str, float], side: Side) -> FootState:
    name = side.name.lower()
    return replace(standing(Footstep(side, _pair(values, name), values[f"{name}_yaw"])), height=values[f"{name}_z"])


def _plan(values: Mapping[str, float], com: CoMState, pendulum: Pendulum, stance: Stance, recording: Recording) -> Plan:
    robot, support, jerk = recording.scenario.robot, stance.feet[0], _pair(values, "jerk")
    period = float(recording.parameters["control_period"])
    after = com.integrated(jerk, period)
    footholds: list[Footstep] = []
    regions: list[Matrix] = []
    before = support
    for name in ("foothold", "foothold2"):
        if math.isnan(values[f"{name}_x"]):
            break
        foothold = Footstep(before.side.other, _pair(values, name), values[f"{name}_yaw"])
        footholds.append(foothold)
        regions.append(robot.foothold_region_at(foothold.yaw - before.yaw, foothold.side))
        before = foothold
    return Plan(
        times=frozen_copy([period]),
        jerks=frozen_copy([jerk]),
        com=frozen_copy([after.position]),
        dcm=frozen_copy([pendulum.dcm(after)]),
        cop=frozen_copy([pendulum.cop(after)]),
        footholds=tuple(footholds),
        stances=(Stance((support,), robot.sole), stance),
        stance_of_sample=np.array([int(stance.is_double_support)]),
        samples_on_support=int(values["samples_on_support"]),
        regions=tuple(regions),
        bounds=NO_BOUNDS,
        status=Status(int(values["status"])),
        is_capturable=True,
    )
