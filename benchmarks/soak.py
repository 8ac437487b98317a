"""Random references and pushes for hours of simulated time, with every promise checked at every tick.

Run `.venv/bin/python benchmarks/soak.py --robot talos --hours 0.2`; it ends with counts, or at a broken promise. With
`--body` the whole body walks, its joint angles stay within limits, and the largest errors of the inverse kinematics and
the shares of the torque limits are printed.
"""

import dataclasses
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import tyro

from walkcore import Command, Push, Reference, Simulation, Snapshot, load_robot
from walkcore.motion.whole_body import WholeBody
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.mpc.regions import half_planes
from walkcore.mpc.stance import Footstep, sole_vertices
from walkcore.robot import BodyModel
from walkcore.scenario.recording import row
from walkcore.values import Vector, rotation

MAX_IK_ERROR = 1e-3  # [m]
MAY_BE_NAN = ("foothold", "true_cop", "time_to_touchdown")


@dataclass
class Soak:
    """Choice of the walk."""

    robot: str = "talos"
    hours: float = 0.1
    push: float = 0.09
    """Largest change of the CoM's velocity by a push [m/s]; one comes every five seconds or so."""
    control_period: float = 0.02
    """Duration of a tick [s]."""
    step_timing: Literal["fixed", "adaptive"] = "adaptive"
    body: bool = False
    """Whether the whole body walks, or the point mass with feet."""
    seed: int = 0


def main(soak: Soak) -> None:
    """Walk, check, count."""
    robot = load_robot(soak.robot)
    robot = robot if soak.body else dataclasses.replace(robot, body=None)
    changes = {"control_period": soak.control_period, "step_timing": soak.step_timing, "dynamic_filter": True}
    simulation = Simulation(robot, robot.parameters.changed(changes))
    rng = np.random.default_rng(soak.seed)
    reference, before, statuses, falls = Reference(), None, {status: 0 for status in Status}, []
    use = None if robot.body is None else Use(robot.body)
    for _ in range(round(soak.hours * 3600 / soak.control_period)):
        if rng.random() < soak.control_period / 3.0:
            limits = robot.max_reference
            values = {n: rng.choice([0.0, lo, hi, rng.uniform(lo, hi)]) for n, (lo, hi) in limits.items()}
            reference = Reference() if rng.random() < 0.3 else Reference(**values)
        angle, strength = rng.uniform(0, 2 * math.pi), rng.uniform(0, soak.push * robot.mass)
        is_pushed = rng.random() < soak.control_period / 5.0
        push = Push(strength * np.array([math.cos(angle), math.sin(angle)])) if is_pushed else None
        now = simulation.step(Command(reference, push))
        check(now, before, simulation)
        if use is not None and now.status is not Status.FALLEN:
            use.check(now)
        statuses[now.status] += 1
        before = now
        if now.status is Status.FALLEN:
            falls.append(now.reason)
            simulation.reset()
            before = None
    print(robot.name, {status.name: count for status, count in statuses.items()}, *sorted(set(falls)), sep="\n")
    if use is not None:
        print(use.summary())


class Use:
    """Errors of the inverse kinematics, and shares of the joints' limits that a walk takes."""

    def __init__(self, body: BodyModel) -> None:
        """Take the limits of a body."""
        self._body = WholeBody(body)
        self._errors: list[tuple[float, float]] = []
        self._torques: list[Vector] = []

    def check(self, now: Snapshot) -> None:
        """Check one tick, and count it.

        Raises:
            AssertionError: naming the tick and the promise.
        """
        model, q = self._body.model, now.q
        assert q is not None and now.torques is not None
        com = [*(now.com.position + now.com_offset), now.com_height]
        error = self._body.errors(q, np.array(com), now.feet)
        assert max(error) < MAX_IK_ERROR, (now.tick, "inverse kinematics off", error)
        beyond = np.maximum(model.lowerPositionLimit - q, q - model.upperPositionLimit)[7:]
        assert np.all(beyond < 1e-6), (now.tick, "joint limit", np.array(model.names)[2:][beyond >= 1e-6])
        self._errors.append(error)
        self._torques.append(np.abs(now.torques) / self._body.max_torques)

    def summary(self) -> str:
        """Largest errors, and the joint that needs most of its torque."""
        com, sole = 1e3 * np.max(self._errors, axis=0)
        shares = np.percentile(self._torques, 99, axis=0)
        most = int(np.argmax(shares))
        joint = self._body.joint_names[most]
        return f"IK errors: CoM {com:.3f}, sole {sole:.3f} mm; torque, p99 of its limit: {shares[most]:.2f} at {joint}"


def check(now: Snapshot, before: Snapshot | None, simulation: Simulation) -> None:
    """Check every promise about one tick.

    Raises:
        AssertionError: naming the tick and the promise.
    """
    robot, period = simulation.robot, simulation.parameters.control_period
    assert all(math.isfinite(v) for n, v in row(now).items() if not n.startswith(MAY_BE_NAN)), (now.tick, "not finite")
    if now.status is Status.FALLEN:
        assert now.reason
        return
    soles = {side: sole_vertices(robot.sole, Footstep(side, f.position, f.yaw)) for side, f in now.feet.items()}
    on_ground = soles[now.support.side] if now.phase is Phase.SINGLE_SUPPORT else np.vstack(list(soles.values()))
    assert half_planes(on_ground).excess(now.cop) < 1e-6, (
        now.tick,
        now.status,
        now.phase,
        "CoP outside",
        half_planes(on_ground).excess(now.cop),
    )
    if before is None:
        return
    for side, foot in now.feet.items():
        move = rotation(before.support.yaw).T @ (foot.position - before.feet[side].position)
        assert np.all(np.abs(move) <= robot.max_foot_speed * period + 1e-9), (now.tick, "foot too fast", move / period)
        assert abs(foot.yaw - before.feet[side].yaw) <= robot.max_foot_yaw_rate * period + 1e-9, (now.tick, "yaw")
    if now.support.side is not before.support.side and before.phase is Phase.SINGLE_SUPPORT:
        stride = rotation(before.support.yaw).T @ (now.support.position - before.support.position)
        region = half_planes(robot.foothold_region_at(now.support.yaw - before.support.yaw, now.support.side))
        assert region.excess(stride) < 1e-5, (now.tick, "foothold outside", stride, region.excess(stride))


if __name__ == "__main__":
    main(tyro.cli(Soak))
