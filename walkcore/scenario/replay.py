"""Snapshots of a recording, for whoever draws it."""

import math
from collections.abc import Iterator, Mapping

import numpy as np

from walkcore.command import Reference
from walkcore.motion.swing_foot import FootState
from walkcore.mpc.gait import Footstep, Phase, Side
from walkcore.mpc.lipm import CoMState
from walkcore.mpc.pattern_generator import Plan, Status
from walkcore.scenario.recording import Recording
from walkcore.snapshot import Snapshot
from walkcore.values import Vector, read_only


def replayed(recording: Recording, every: int) -> Iterator[Snapshot]:
    """One snapshot for every so many rows, the first one's to begin with.

    What a recording does not hold is missing: the plan ends with the coming tick but for its footholds, the foot in
    the air has no speed, and there are no torques.
    """
    joints = [i for i, name in enumerate(recording.columns) if name.startswith("q_")]
    for k in range(0, len(recording.rows), every):
        numbers = recording.rows[k]
        values = dict(zip(recording.columns, numbers.tolist(), strict=True))
        yield _snapshot(values, numbers[joints] if joints else None, recording)


def _snapshot(values: Mapping[str, float], q: Vector | None, recording: Recording) -> Snapshot:
    v, status = values, Status(int(values["status"]))
    com = CoMState(_pair(v, "com"), np.array([v["com_vx"], v["com_vy"]]), np.array([v["com_ax"], v["com_ay"]]))
    support = Footstep(Side(int(v["support_side"])), _pair(v, "support"), v["support_yaw"])
    return Snapshot(
        tick=int(v["tick"]),
        t=v["t"],
        com=com,
        com_height=v["com_z"],
        jerk=_pair(v, "jerk"),
        cop=_pair(v, "cop"),
        true_cop=None if math.isnan(v["true_cop_x"]) else _pair(v, "true_cop"),
        torques=None,
        reference=Reference(v["reference_vx"], v["reference_vy"], v["reference_yaw_rate"]),
        heading=(v["left_yaw"] + v["right_yaw"]) / 2,
        phase=Phase(int(v["phase"])),
        support=support,
        samples_on_support=int(v["samples_on_support"]),
        time_to_touchdown=v["time_to_touchdown"],
        steps_to_stand=int(v["steps_to_stand"]),
        left_foot=_foot(v, "left"),
        right_foot=_foot(v, "right"),
        push=_pair(v, "push"),
        status=status,
        reason=recording.reason if status is Status.FALLEN else "",
        plan=None if status is Status.FALLEN else _plan(v, com, support, recording),
        com_offset=_pair(v, "com_offset"),
        q=None if q is None else read_only(q),
    )


def _pair(values: Mapping[str, float], name: str) -> Vector:
    return read_only([values[f"{name}_x"], values[f"{name}_y"]])


def _foot(values: Mapping[str, float], name: str) -> FootState:
    pose = np.array([values[f"{name}_x"], values[f"{name}_y"], values[f"{name}_yaw"]])
    return FootState(pose, np.zeros(3), np.zeros(3), values[f"{name}_z"])


def _plan(values: Mapping[str, float], com: CoMState, support: Footstep, recording: Recording) -> Plan:
    p, jerk = recording.parameters, _pair(values, "jerk")
    period = float(p["control_period"])
    soon = com.integrated(jerk, period)
    footholds: list[Footstep] = []
    side = support.side
    for name in ("foothold", "foothold2"):
        side = side.other
        if not math.isnan(values[f"{name}_x"]):
            footholds.append(Footstep(side, _pair(values, name), values[f"{name}_yaw"]))
    return Plan(
        times=read_only([period]),
        jerks=read_only([jerk]),
        com=read_only([soon.position]),
        cop=read_only([soon.cop(float(p["com_height"]), float(p["gravity"]))]),
        footholds=tuple(footholds),
        status=Status(int(values["status"])),
        is_capturable=True,
    )
