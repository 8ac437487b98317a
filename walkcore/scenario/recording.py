"""The recording of a walk: one row a tick, and all that is needed to check it from outside."""

import json
import math
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from walkcore.analysis.columns import BodyUse
from walkcore.analysis.metrics import metrics
from walkcore.motion.whole_body import WholeBody
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Footstep, Side
from walkcore.parameters import Parameters
from walkcore.plant.world import PERFECT
from walkcore.robot import Robot
from walkcore.scenario.expectations import Verdict
from walkcore.scenario.scenario import Scenario
from walkcore.simulation import Simulation
from walkcore.snapshot import PlantTick, Snapshot
from walkcore.stages import time_of_solves
from walkcore.values import Matrix, Vector

PACKAGES = ("numpy", "piqp", "daqp", "pin", "pin-pink", "quadprog", "example-robot-data")
PHYSICS = "mujoco-core"  # needed by a plant with contact physics only
NOWHERE = (math.nan, math.nan, math.nan)
TWIN_COLUMNS = {"com_x", "com_y", "cop_x", "cop_y", "status"} | {
    f"{foot}_{c}" for foot in ("left", "right") for c in ("x", "y", "z", "yaw")
}
"""Columns that the ideal robot beside another plant has, too, with `twin_` before their names, as its joints have."""


def package_versions(plant: str) -> dict[str, str]:
    """Versions of the packages that decide the numbers of a walk.

    Args:
        plant: that it has.
    """
    packages = ("walk", *PACKAGES, *(() if plant == "ideal" else (PHYSICS,)))
    return {name: version(name) for name in packages} | {"python": platform.python_version()}


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


def plant_columns(snapshot: Snapshot) -> dict[str, float]:
    """The columns of a plant that is not the ideal one, but for its joints, and of the ideal twin; empty without."""
    columns = {} if snapshot.plant is None else _measured_columns(snapshot.plant)
    if snapshot.twin is not None:
        columns |= {f"twin_{name}": value for name, value in row(snapshot.twin).items() if name in TWIN_COLUMNS}
    return columns


def joint_columns(name: str, q: Vector | None) -> dict[str, float]:
    """The columns of a configuration, shape (nq,), by the number of each; none of a robot without a body."""
    return {} if q is None else {f"{name}_{i}": float(number) for i, number in enumerate(q)}


def _measured_columns(plant: PlantTick) -> dict[str, float]:
    columns: dict[str, float] = {}
    body = plant.measured
    names = tuple(f"measured_com_{c}" for c in ("x", "y", "z", "vx", "vy"))
    _put(columns, names, (*body.com, *body.com_velocity[:2]))
    for side in Side:
        sole = body.soles[side]
        names = tuple(f"measured_{side.name.lower()}_{c}" for c in ("x", "y", "z", "yaw"))
        _put(columns, names, (*sole.position, sole.yaw))
    for name, cop in (("ground_cop", plant.contact.cop), ("commanded_cop", plant.commanded_cop)):
        _put(columns, (f"{name}_x", f"{name}_y"), NOWHERE[:2] if cop is None else cop)
    _put(columns, ("left_force", "right_force"), (plant.contact.forces[side] for side in Side))
    _put(columns, ("dcm_error_x", "dcm_error_y"), plant.dcm_error)
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
    """All that the QP used, at the first tick."""
    parameter_changes: tuple[Mapping[str, Any], ...]
    """`tick` of the recording from which on some `parameters` have other values, in the order of time."""
    reason: str
    """Reason of the fall; empty if there was none."""
    body_use: BodyUse | None
    """None for a robot without a body."""

    def __getitem__(self, column: str) -> Vector:
        """One column, shape (ticks,)."""
        return self.rows[:, self.columns.index(column)]

    def metrics(self) -> dict[str, Any]:
        """The metrics of the walk."""
        return metrics(self)

    def verdicts(self) -> list[Verdict]:
        """The verdicts on the scenario's expectations."""
        return _verdicts(self.scenario, self.metrics())

    def run(self) -> dict[str, Any]:
        """The content of run.json, as plain values: the same for every walk of the scenario, wherever and whenever."""
        measured = self.metrics()
        return {
            "scenario": self.scenario.source,
            "parameters": self.parameters,
            "parameter_changes": self.parameter_changes,
            "versions": package_versions(self.scenario.parameters.plant),
            "metrics": measured,
            "expectations": [asdict(verdict) for verdict in _verdicts(self.scenario, measured)],
        }

    def run_json(self) -> str:
        """The text of run.json."""
        return json.dumps(self.run(), indent=2, default=float, allow_nan=False) + "\n"

    def write_npz(self, path: Path) -> None:
        """Write an array for each column."""
        with path.open("wb") as file:  # a path would be given the ending that NumPy likes
            np.savez(file, allow_pickle=False, **{name: self[name] for name in self.columns})

    def write_csv(self, path: Path) -> None:
        """Write a line for each tick, below the names of the columns."""
        header = ",".join(self.columns)
        np.savetxt(path, self.rows, fmt="%.17g", delimiter=",", header=header, comments="")

    def write(self, folder: Path) -> None:
        """Write recording.npz, recording.csv and run.json into a folder, which is made if need be."""
        folder.mkdir(parents=True, exist_ok=True)
        self.write_npz(folder / "recording.npz")
        self.write_csv(folder / "recording.csv")
        (folder / "run.json").write_text(self.run_json(), encoding="utf-8")


def _verdicts(scenario: Scenario, measured: Mapping[str, Any]) -> list[Verdict]:
    return [expectation.verdict(measured) for expectation in scenario.expectations]


def parameters_in_force(robot: Robot, parameters: Parameters) -> dict[str, Any]:
    """All that the QP uses, by the names of the contract: enough to rebuild every one of them."""
    body = robot.body
    return parameters.to_mapping() | {
        "robot": robot.name,
        "mass": robot.mass,
        "com_height": robot.pendulum(parameters).height,
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
    """Simulate a scenario as fast as the machine can.

    Args:
        scenario: to be walked.
        progress: called with the fraction done, about a hundred times.

    Raises:
        InverseKinematicsError: if the body cannot stand at this CoM height.
    """
    simulation = Simulation(scenario.robot, scenario.parameters, world=scenario.world)
    if scenario.initial_state is not None:
        simulation.restore(scenario.initial_state)
    every = max(scenario.nb_ticks // 100, 1)

    def walked() -> Iterator[Snapshot]:
        for tick, snapshot in enumerate(_walked(simulation, scenario), 1):
            if progress is not None and tick % every == 0:
                progress(tick / scenario.nb_ticks)
            yield snapshot

    return collect(scenario, walked(), simulation.body)


def _walked(simulation: Simulation, scenario: Scenario) -> Iterator[Snapshot]:
    changes, solves = list(scenario.parameter_changes()), scenario.solves_in_time()
    for tick, command in enumerate(scenario.commands()):
        while changes and changes[0][0] <= tick:
            simulation.change(changes.pop(0)[1])
        yield simulation.step(command, time_of_solves(solves.get(tick)))


def collect(scenario: Scenario, snapshots: Iterable[Snapshot], body: WholeBody | None) -> Recording:
    """The recording of the snapshots of a scenario, one a tick.

    Args:
        scenario: that leads to them.
        snapshots: read once.
        body: of the scenario's robot, for what its kinematics tell; None if it has none.
    """
    columns: tuple[str, ...] = ()
    rows: list[dict[str, float]] = []
    efforts: list[Vector] = []
    reason = ""
    for snapshot in snapshots:
        values = row(snapshot)
        # To rebuild stops, to find the body's CoM where the dynamic filter moves it, and to rebuild shortened steps.
        more = {"steps_to_stand": float(snapshot.steps_to_stand)}
        _put(more, ("com_offset_x", "com_offset_y"), snapshot.com_offset)
        more |= {"step_duration": snapshot.step_duration, "next_step_duration": snapshot.next_step_duration}
        later = [foot.yaw for foot in (snapshot.plan.footholds[2:] if snapshot.plan is not None else ())]
        _put(more, ("foothold3_yaw", "foothold4_yaw"), [*later, math.nan, math.nan][:2])
        more |= plant_columns(snapshot)
        if snapshot.plant is not None:
            more |= joint_columns("q_commanded", snapshot.plant.q_commanded)
        if snapshot.twin is not None:
            more |= joint_columns("twin_q", snapshot.twin.q)
        rows.append(values | joint_columns("q", snapshot.q) | more)
        if len(rows[-1]) != len(columns):  # a twin may come and go
            columns = tuple(dict.fromkeys((*columns, *rows[-1])))
        if snapshot.status is Status.FALLEN:
            reason = reason or snapshot.reason
        if body is not None:
            efforts.append(_effort(body, snapshot))
    table = np.array([[values.get(name, math.nan) for name in columns] for values in rows])
    use = None if body is None else _body_use(body, table, columns, np.array(efforts), scenario.parameters)
    return Recording(
        scenario=scenario,
        columns=columns,
        rows=table,
        parameters=parameters_in_force(scenario.robot, scenario.parameters)
        | ({} if scenario.world == PERFECT else {"world": scenario.world.to_mapping()}),
        parameter_changes=_changes(scenario, int(table[0, 0])),
        reason=reason,
        body_use=use,
    )


def _effort(body: WholeBody, snapshot: Snapshot) -> Vector:
    """Error of the CoM and of the soles [m], then the torques [N m], at one tick; NaN once the robot has fallen."""
    if snapshot.q is None or snapshot.torques is None:
        return np.full(2 + len(body.joint_names), math.nan)
    com = np.array([*(snapshot.com.position + snapshot.com_offset), snapshot.com_height])
    q = snapshot.q if snapshot.plant is None else snapshot.plant.q_commanded
    return np.array([*body.errors(q, com, snapshot.feet), *snapshot.torques])


def _body_use(
    body: WholeBody, table: Matrix, columns: tuple[str, ...], efforts: Matrix, parameters: Parameters
) -> BodyUse:
    first = columns.index("q_0") + 7  # behind the floating base
    angles = table[:, first : first + len(body.joint_names)]
    speeds = np.abs(np.diff(angles, axis=0)) / parameters.control_period
    return BodyUse(
        joints=body.joint_names,
        torque=np.abs(efforts[:, 2:]) / body.max_torques,
        speed=speeds / body.max_speeds,
        com_error=efforts[:, 0],
        sole_error=efforts[:, 1],
    )


def _changes(scenario: Scenario, first_tick: int) -> tuple[Mapping[str, Any], ...]:
    """Each change of parameters by the names of the contract, with what has another value."""
    changes: list[Mapping[str, Any]] = []
    before = parameters_in_force(scenario.robot, scenario.parameters)
    for tick, parameters in scenario.parameter_changes():
        after = parameters_in_force(scenario.robot, parameters)
        changed = {name: value for name, value in after.items() if value != before[name]}
        changes.append({"tick": first_tick + tick, "parameters": changed})
        before = after
    return tuple(changes)
