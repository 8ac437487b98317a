"""The tables of a report, as rows of text: the first row names the columns."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from app.formats import StoredRun
from walkcore.analysis.columns import has_column, points
from walkcore.analysis.twin import twin_steps
from walkcore.mpc.plan import Status
from walkcore.scenario.expectations import METRICS

Rows = list[list[str]]
MOST_JOINTS = 10


def text(value: Any) -> str:
    """A value as text: numbers with four digits, None as a dash."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}" if abs(value) >= 1e-6 or value == 0.0 else f"{value:.1e}"
    if isinstance(value, list | tuple):
        return ", ".join(map(text, value))
    return str(value)


def facts(run: StoredRun) -> Rows:
    """Robot, scheme, horizon and outcome of a run."""
    p, counts = run.parameters, run.metrics["status_counts"]
    return [
        ["", ""],
        ["robot", f"{p['robot']}, {p['mass']:g} kg, CoM {p['com_height']:g} m high"],
        ["scheme", f"{p['scheme']}: α {p['alpha']:g}, β {p['beta']:g}, γ {p['gamma']:g}"],
        [
            "horizon",
            f"N = {p['horizon_samples']}, T = {p['sampling_period']:g} s, a tick {1e3 * p['control_period']:g} ms",
        ],
        ["ticks", f"{run.metrics['ticks']}, {text(run.metrics['duration'])} s"],
        ["status", ", ".join(f"{counts[name]} {name}" for name in counts)],
        ["fallen", run.reason or "no"],
        ["versions", ", ".join(f"{name} {version}" for name, version in run.run["versions"].items())],
    ]


def metric_rows(run: StoredRun) -> Rows:
    """Every metric that the run has."""
    rows = [[name, text(run.metrics[name]), METRICS[name]] for name in METRICS if run.metrics.get(name) is not None]
    return [["metric", "value", "what it is"], *rows]


def expectation_rows(run: StoredRun) -> Rows:
    """Expectations of the scenario, each with what was measured; only the head if there were none."""
    verdicts: Sequence[Mapping[str, Any]] = run.run.get("expectations", [])
    rows = [[v["name"], text(v["bound"]), text(v["measured"]), "holds" if v["holds"] else "BROKEN"] for v in verdicts]
    return [["expectation", "bound", "measured", ""], *rows]


def twin_rows(run: StoredRun) -> Rows:
    """The robot in physics beside its ideal twin; only the head without one."""
    rows: Rows = [["", "robot in physics", "ideal twin"]]
    if not has_column(run, "twin_status"):
        return rows
    period, falls, ends = float(run.parameters["control_period"]), [], []
    for status, com in (("status", "measured_com"), ("twin_status", "twin_com")):
        fallen = np.flatnonzero(run[status] == Status.FALLEN)
        falls.append(f"after {fallen[0] * period:.2f} s" if len(fallen) else "no")
        x, y = points(run, com)[np.isfinite(run[f"{com}_x"])][-1]
        ends.append(f"{x:.2f}, {y:.2f}")
    landed = twin_steps(run)
    rows += [["fallen", *falls], ["CoM at the end, x, y [m]", *ends], ["steps", str(len(landed)), ""]]
    if len(landed):
        k, feet, twin_feet = landed[-1]
        rows.append([f"length of the last step, at {run['t'][k]:.2f} s [m]", f"{feet:.3f}", f"{twin_feet:.3f}"])
        most = max(landed, key=lambda step: abs(step[1] - step[2]))
        where = f"length of the step that differs most, at {run['t'][most[0]]:.2f} s [m]"
        rows.append([where, f"{most[1]:.3f}", f"{most[2]:.3f}"])
    distance = run.metrics.get("twin_distance")
    return [*rows, ["largest distance while both are up [m]", text(distance), ""]]


def steady_rows(run: StoredRun) -> Rows:
    """Mean velocity over whole gait cycles against the reference."""
    rows = [
        [f"{s['start']:g} to {s['end']:g}", text(s["cycles"]), text(s["reference"]), text(s["mean_velocity"])]
        for s in run.metrics["steady_walks"]
    ]
    return [["time [s]", "gait cycles", "reference vx, vy [m/s], yaw rate [rad/s]", "mean"], *rows]


def push_rows(run: StoredRun) -> Rows:
    """Recovery from each push."""
    rows = [
        [text(p["t"]), text(p["impulse"]), text(p["time"]), text(p["steps"]), text(p["com_deviation"])]
        for p in run.metrics["pushes"]
    ]
    return [["time [s]", "impulse [N s]", "recovered after [s]", "steps", "CoM deviation [m]"], *rows]


def joint_rows(run: StoredRun) -> Rows:
    """The joints whose torque comes nearest to its limit."""
    joints: Mapping[str, Mapping[str, Any]] = run.metrics["joints"]
    hardest = sorted(joints, key=lambda name: -(joints[name]["torque_use_p99"] or 0.0))[:MOST_JOINTS]
    uses = ("torque_use_p99", "torque_use", "speed_use_p99", "speed_use")
    rows = [[name, *(text(joints[name][use]) for use in uses)] for name in hardest]
    return [["joint", "torque, p99", "torque, max", "speed, p99", "speed, max"], *rows]


def comparison_rows(runs: Sequence[StoredRun], names: Sequence[str]) -> Rows:
    """Every metric that one of the runs has, side by side."""
    rows: Rows = [["", *names], ["robot", *(run.parameters["robot"] for run in runs)]]
    rows += [["scenario", *(run.name for run in runs)], ["fallen", *(run.reason or "no" for run in runs)]]
    if any(run.metrics.get("twin_difference") for run in runs):
        rows.append(["ideal twin", *(text(run.metrics.get("twin_difference") or None) for run in runs)])
    for name in METRICS:
        values = [run.metrics.get(name) for run in runs]
        if any(value is not None for value in values):
            rows.append([name, *map(text, values)])
    return rows


def changed_parameters(runs: Sequence[StoredRun], names: Sequence[str]) -> Rows:
    """Parameters in which the runs differ."""
    keys = [key for key, value in runs[0].parameters.items() if isinstance(value, int | float | str | bool | None)]
    rows = [[key, *(text(run.parameters.get(key)) for run in runs)] for key in keys]
    return [["parameter", *names], *(row for row in rows if len(set(row[1:])) > 1)]
