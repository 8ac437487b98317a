"""How far the method carries in contact physics: a table for Talos at 200 Hz, on all cores.

python benchmarks/physics.py [--rows straight mixed ...]
"""

import argparse
import math
import os
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from walkcore import Command, Parameters, Push, Reference, Simulation, Snapshot, load_robot
from walkcore.mpc.plan import Status
from walkcore.plant.world import PERFECT, World

TALOS = load_robot("talos")
PHYSICS = Parameters(plant="mujoco", dynamic_filter=True, initial_double_support_duration=0.3)
IDEAL = replace(PHYSICS, plant="ideal", dynamic_filter=False)
PERIOD = PHYSICS.control_period  # [s]
WARM_UP = 2.0  # [s] before figures count
AHEAD = Reference(vx=0.3)
MIXED = [  # (s, reference): turns, sideways, backwards, stop, start
    (0.0, AHEAD),
    (12.0, Reference(vx=0.2, yaw_rate=0.3)),
    (22.0, Reference()),
    (26.0, Reference(vy=0.1)),
    (36.0, Reference(vx=-0.15)),
    (46.0, Reference(vx=0.1, yaw_rate=-0.3)),
    (54.0, AHEAD),
]
NB_PUSHES = 16
AT_COM = {"link": "torso_2_joint", "point": [0.0, 0.0, -0.21]}
"""Place of a push as high as the CoM, where the model is pushed; the torso is pushed 0.38 m above it."""
WORLDS = {
    "10 ms delay": World(delay=0.01),
    "mass +5 %": World(mass_error=0.05),
    "mass -5 %": World(mass_error=-0.05),
    "friction 0.4": World(friction=0.4),
    "friction 1.0": World(friction=1.0),
    "strips of 1 cm": World(strip_height=0.01),
    "strips of 2 cm": World(strip_height=0.02),
    "slope of 0.03 rad": World(slope=0.03),
}


@dataclass(frozen=True)
class Walked:
    """The figures of one walk."""

    seconds: float
    """Simulated time until the end or the fall."""
    reason: str
    cop_median: float
    """Contact CoP to the model's [cm]."""
    cop_p95: float
    dcm_max: float
    """[cm]."""
    velocity: tuple[float, float, float]
    """Mean velocity in the world [m/s], and mean yaw rate [rad/s]."""
    end: tuple[float, float, float]
    """CoM at the end [m], and heading [rad]."""
    torque_p99: float
    """Torque over its limit, 99th percentile of the joint that has the highest."""
    tick_mean: float
    """Processor time [ms]."""
    tick_p99: float

    def __str__(self) -> str:
        """A line of the table."""
        fate = self.reason or "walks on"
        return (
            f"CoP {self.cop_median:.2f} / {self.cop_p95:.2f} cm, DCM max {self.dcm_max:.2f} cm, "
            f"vx {self.velocity[0]:.3f} vy {self.velocity[1]:.3f} m/s, torque {self.torque_p99:.2f}, "
            f"end ({self.end[0]:.2f}, {self.end[1]:.2f}) m {math.degrees(self.end[2]):.1f} deg, "
            f"tick {self.tick_mean:.2f} ms p99 {self.tick_p99:.2f}; {fate} ({self.seconds:.0f} s)"
        )


def walk(duration: float, world: World, references: list[tuple[float, Reference]], pushes: dict[int, Push]) -> Walked:
    """Walk in physics and take the figures."""
    simulation = Simulation(TALOS, PHYSICS, world=world)
    limits = simulation.body.max_torques
    cop, dcm, torques, costs, poses = [], [], [], [], []
    reference, reason, snapshot = Reference(), "", None
    waiting = list(references)
    for tick in range(round(duration / PERIOD)):
        if waiting and waiting[0][0] <= tick * PERIOD:
            reference = waiting.pop(0)[1]
        begin = time.thread_time()
        snapshot = simulation.step(Command(reference, pushes.get(tick)))
        costs.append(1e3 * (time.thread_time() - begin))
        if snapshot.status is Status.FALLEN:
            reason = snapshot.reason
            break
        if tick * PERIOD < WARM_UP:
            continue
        contact = snapshot.plant.contact
        if contact.cop is not None:
            cop.append(100 * math.dist(contact.cop, snapshot.cop))
        dcm.append(100 * math.hypot(*snapshot.plant.dcm_error))
        torques.append(np.abs(snapshot.torques) / limits)
        poses.append([*snapshot.plant.measured.com[:2], snapshot.heading])
    poses = np.array(poses)
    return Walked(
        seconds=len(costs) * PERIOD,
        reason=reason,
        cop_median=float(np.median(cop)),
        cop_p95=float(np.percentile(cop, 95)),
        dcm_max=max(dcm),
        velocity=tuple((poses[-1] - poses[0]) / (len(poses) * PERIOD)),
        end=tuple(poses[-1]),
        torque_p99=float(np.max(np.percentile(torques, 99, axis=0))),
        tick_mean=float(np.mean(costs)),
        tick_p99=float(np.percentile(costs, 99)),
    )


@dataclass(frozen=True)
class PushTest:
    """Pushes of varied direction and phase of the gait."""

    strength: float
    """[N s]."""
    is_walking: bool
    step_timing: str = "fixed"
    is_at_com: bool = False
    """Whether the body is pushed as high as its CoM, instead of at the CoM of its torso."""
    world: World = PERFECT

    def survives(self, number: int, plant: str) -> bool:
        """Whether Talos is up 6 s after a push of a direction and phase that follow from its number."""
        is_ideal = plant == "ideal"
        parameters = replace(IDEAL if is_ideal else PHYSICS, step_timing=self.step_timing)
        robot, world = (replace(TALOS, body=None), PERFECT) if is_ideal else (TALOS, self.world)
        simulation, place = Simulation(robot, parameters, world=world), AT_COM if self.is_at_com else {}
        angle, at = 2 * math.pi * (number * 5 % NB_PUSHES) / NB_PUSHES, 600 + number * 23 % 160 * self.is_walking
        impulse = [self.strength * math.cos(angle), self.strength * math.sin(angle)]
        push = Push(impulse, frame="world", **({} if is_ideal else place))
        for tick in range(at + 1200):
            reference = AHEAD if self.is_walking else Reference()
            snapshot: Snapshot = simulation.step(Command(reference, push if tick == at else None))
            if snapshot.status is Status.FALLEN:
                return False
        return True

    def row(self, pool: ProcessPoolExecutor) -> str:
        """The line of the table."""
        tries = [
            [pool.submit(self.survives, number, plant) for number in range(NB_PUSHES)] for plant in ("mujoco", "ideal")
        ]
        real, ideal = (sum(future.result() for future in one) for one in tries)
        how = f"{'walking' if self.is_walking else 'standing'}, {self.step_timing} timing"
        where = ", as high as the CoM" * self.is_at_com + ", noise" * (self.world.sensors == "noisy")
        return f"{self.strength:.0f} N s, {how}{where}: {real} of {NB_PUSHES} survived (ideal model: {ideal})"


def rows(pool: ProcessPoolExecutor, wanted: set[str]) -> Iterator[str]:
    """The lines of the table, each as soon as it is known."""
    flat = PERFECT
    if "straight" in wanted:
        yield f"60 s at 0.3 m/s: {pool.submit(walk, 60.0, flat, [(0.0, AHEAD)], {}).result()}"
    if "mixed" in wanted:
        yield f"60 s mixed: {pool.submit(walk, 60.0, flat, MIXED, {}).result()}"
    if "pushes" in wanted:
        for is_walking in (True, False):
            for strength in (12.0, 20.0, 30.0):
                yield PushTest(strength, is_walking).row(pool)
    if "adaptive" in wanted:
        for is_at_com in (False, True):
            for strength in (20.0, 30.0):
                yield PushTest(strength, True, "adaptive", is_at_com).row(pool)
    if "worlds" in wanted:
        two = {1200: Push([0.0, 9.0], frame="world"), 2420: Push([9.0, 0.0], frame="world")}
        walks = {name: pool.submit(walk, 20.0, world, [(0.0, AHEAD)], two) for name, world in WORLDS.items()}
        for name, future in walks.items():
            yield f"{name}, two pushes of 9 N s: {future.result()}"
    if "noise" in wanted:
        noisy = World(sensors="noisy")
        yield f"noise and an estimator, 60 s: {pool.submit(walk, 60.0, noisy, [(0.0, AHEAD)], {}).result()}"
        for is_walking in (True, False):
            yield PushTest(12.0, is_walking, world=noisy).row(pool)
    if "far" in wanted:
        yield f"100 m: {pool.submit(walk, 340.0, flat, [(0.0, AHEAD)], {}).result()}"


ROWS = ("straight", "mixed", "pushes", "adaptive", "worlds", "noise", "far")

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=ROWS)
    with ProcessPoolExecutor(len(os.sched_getaffinity(0))) as processes:
        for line in rows(processes, set(parser.parse_args().rows)):
            print(line, flush=True)
