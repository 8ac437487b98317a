"""What a walk leaves behind: one row a tick, and all that is needed to check it from outside."""

import json
import math
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from walkcore.gait import Footstep
from walkcore.pattern_generator import Status
from walkcore.scenario import Scenario
from walkcore.simulation import Simulation
from walkcore.snapshot import Snapshot
from walkcore.values import Matrix, Vector

PACKAGES = ("numpy", "piqp", "daqp", "pin", "pin-pink", "quadprog", "example-robot-data")
NOWHERE = (math.nan, math.nan, math.nan)


def row(snapshot: Snapshot) -> dict[str, float]:
    """The columns of a recording at one tick, without the joints: SI units, world frame."""
    s = snapshot
    footholds = [_place(foot) for foot in (s.plan.footholds if s.plan is not None else ())] + [NOWHERE, NOWHERE]
    true_cop = (math.nan, math.nan) if s.true_cop is None else s.true_cop
    columns: dict[str, float] = {"tick": s.tick, "t": s.t}
    _put(columns, ("com_x", "com_y", "com_z"), (*s.com.position, s.com_height))
    _put(columns, ("com_vx", "com_vy", "com_ax", "com_ay"), (*s.com.velocity, *s.com.acceleration))
    _put(columns, ("jerk_x", "jerk_y"), s.jerk)
    _put(columns, ("cop_x", "cop_y", "true_cop_x", "true_cop_y"), (*s.cop, *true_cop))
    names = ("reference_vx", "reference_vy", "reference_yaw_rate")
    _put(columns, names, (s.reference.vx, s.reference.vy, s.reference.yaw_rate))
    columns |= {"phase": s.phase.value, "support_side": s.support.side.value}
    _put(columns, ("support_x", "support_y", "support_yaw"), _place(s.support))
    columns["samples_on_support"] = s.samples_on_support
    _put(columns, ("foothold_x", "foothold_y", "foothold_yaw"), footholds[0])
    _put(columns, ("foothold2_x", "foothold2_y", "foothold2_yaw"), footholds[1])
    columns["time_to_touchdown"] = s.time_to_touchdown
    for name, foot in (("left", s.left_foot), ("right", s.right_foot)):
        _put(columns, tuple(f"{name}_{c}" for c in ("x", "y", "z", "yaw")), (*foot.position, foot.height, foot.yaw))
    _put(columns, ("push_x", "push_y"), s.push)
    columns["status"] = s.status.value
    return columns


def _put(columns: dict[str, float], names: tuple[str, ...], values: Any) -> None:
    columns.update(zip(names, map(float, values), strict=True))


def _place(foot: Footstep) -> tuple[float, float, float]:
    return float(foot.position[0]), float(foot.position[1]), foot.yaw


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A scenario and the rows of its walk."""

    scenario: Scenario
    columns: tuple[str, ...]
    """Names, in the order of the contract."""
    rows: Matrix
    """One row a tick, shape (ticks, columns)."""
    parameters: Mapping[str, Any]
    """All that the QP used."""
    reason: str
    """Why the robot fell, if it did."""
    torque_use: Mapping[str, Vector]
    """Torque over effort limit of each joint at each tick, shape (ticks,); empty for a robot without a body."""

    def __getitem__(self, column: str) -> Vector:
        """One column, shape (ticks,)."""
        return self.rows[:, self.columns.index(column)]

    def metrics(self) -> dict[str, Any]:
        """What a reader asks of a walk first."""
        true_error = np.hypot(self["true_cop_x"] - self["cop_x"], self["true_cop_y"] - self["cop_y"])
        true_error = true_error[np.isfinite(true_error)]
        percentiles = np.percentile(true_error, (50, 95, 100)) if len(true_error) else (None, None, None)
        return {
            "ticks": len(self.rows),
            "duration": len(self.rows) * self.parameters["control_period"],
            "mean_velocity": [float(self["com_vx"].mean()), float(self["com_vy"].mean())],
            "ticks_relaxed": int(np.sum(self["status"] == Status.RELAXED)),
            "has_fallen": bool(np.any(self["status"] == Status.FALLEN)),
            "reason": self.reason,
            # A push or a foothold that moves at the last moment is a jerk of one tick: the p99 is what a motor feels.
            "torque_use_p99": {joint: float(np.percentile(use, 99)) for joint, use in self.torque_use.items()},
            "torque_use_max": {joint: float(np.max(use)) for joint, use in self.torque_use.items()},
            "true_cop_error": dict(zip(("median", "p95", "max"), percentiles, strict=True)),
        }

    def write(self, folder: Path) -> None:
        """Write recording.npz, recording.csv and run.json into a folder, which is made if need be."""
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(folder / "recording.npz", allow_pickle=False, **{name: self[name] for name in self.columns})
        header = ",".join(self.columns)
        np.savetxt(folder / "recording.csv", self.rows, fmt="%.17g", delimiter=",", header=header, comments="")
        run = {
            "scenario": self.scenario.source,
            "parameters": self.parameters,
            "versions": {name: version(name) for name in ("walk", *PACKAGES)} | {"python": platform.python_version()},
            "metrics": self.metrics(),
        }
        (folder / "run.json").write_text(json.dumps(run, indent=2, default=float) + "\n", encoding="utf-8")


def parameters_in_force(simulation: Simulation) -> dict[str, Any]:
    """All that the QP uses, by the names of the contract: enough to rebuild every one of them."""
    robot = simulation.robot
    body = robot.body
    return simulation.parameters.to_mapping() | {
        "robot": robot.name,
        "mass": robot.mass,
        "com_height": simulation.com_height,
        "stance_width": robot.stance_width,
        "sole": {
            "polygon": robot.sole.tolist(),
            "frame": {"left": body.left_sole, "right": body.right_sole} if body is not None else None,
        },
        "foothold_region": robot.foothold_region.tolist(),
        "foothold_regions": [
            {"yaw": [region.lowest_yaw, region.highest_yaw], "region": region.vertices.tolist()}
            for region in robot.foothold_regions
        ],
        "max_foot_speed": robot.max_foot_speed.tolist(),
        "max_foot_yaw_rate": robot.max_foot_yaw_rate,
        "max_com_distance": robot.max_com_distance,
        "max_reference": {name: list(limits) for name, limits in robot.max_reference.items()},
        "rules": {
            "samples": "the first lies on the next multiple of sampling_period, the others follow a period apart",
            "standing": "before the first step, samples up to its beginning may have their CoP anywhere in the hull of"
            " both soles less the margin, and are drawn (gamma) to the middle between the feet",
            "foothold_region": "of a left foot in the right foot's frame, straight; mirrored in y for a right foot",
            "foothold_regions": "the same by the yaw of the left foot against the right foot: the nearest band counts",
            "mirror": "a right sole is the left one mirrored in y",
        },
    }


def record(scenario: Scenario, progress: Callable[[float], None] | None = None) -> Recording:
    """Simulate a scenario from rest, as fast as the machine can.

    Args:
        scenario: to be walked.
        progress: called with the fraction done, about a hundred times.

    Raises:
        InverseKinematicsError: if the body cannot stand at the CoM height asked for.
    """
    simulation = Simulation(scenario.robot, scenario.parameters)
    every = max(scenario.nb_ticks // 100, 1)
    columns: tuple[str, ...] = ()
    rows: list[list[float]] = []
    reason, body = "", simulation.body
    torques: list[Vector] = []
    for tick, command in enumerate(scenario.commands()):
        snapshot = simulation.step(command)
        values = row(snapshot)
        # Beyond the contract: to rebuild stops, and to find the body's CoM where the dynamic filter moves it.
        more = {"steps_to_stand": float(snapshot.steps_to_stand)}
        _put(more, ("com_offset_x", "com_offset_y"), snapshot.com_offset)
        joints = {} if snapshot.q is None else {f"q_{i}": float(angle) for i, angle in enumerate(snapshot.q)}
        columns = columns or (*values, *joints, *more)
        rows.append([*values.values(), *joints.values(), *more.values()])
        reason = reason or snapshot.reason
        if snapshot.torques is not None:
            torques.append(np.abs(snapshot.torques))
        if progress is not None and (tick + 1) % every == 0:
            progress((tick + 1) / scenario.nb_ticks)
    use = {} if body is None else dict(zip(body.joint_names, (np.array(torques) / body.max_torques).T, strict=True))
    return Recording(scenario, columns, np.array(rows), parameters_in_force(simulation), reason, use)
