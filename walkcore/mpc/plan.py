"""The decision of one tick: trajectories, footsteps, stances, and the bounds that the optimum rests on."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from walkcore.mpc.regions import inset_vertices
from walkcore.mpc.stance import Footstep, Stance, convex_hull
from walkcore.values import Matrix, Vector, rotation

MULTIPLIER_TOLERANCE = 1e-6  # an interior-point solver leaves this much on bounds that are not active


class Status(IntEnum):
    """Outcome of a tick; numbered as in a recording."""

    SOLVED = 0
    """The optimum of the paper's QP."""
    RELAXED = 1
    """Another plan, because that QP has no solution or leads to a fall."""
    FALLEN = 2


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """The rows of the QP, with their multipliers at the optimum."""

    point: NDArray[np.int64]
    """Number of the point that each row holds, shape (r,): the N CoPs, the m footholds, then the flight (30)."""
    normals: Matrix
    """Normal of the edge of each row, in the world, shape (r, 2)."""
    multipliers: Vector
    """Positive where a point touches that edge, negative where it touches the opposite one, else zero, shape (r,)."""

    def active(self) -> Iterator[tuple[int, Vector]]:
        """The points that are held, each with the outward normal of the edge that it touches, shape (2,)."""
        for row in np.flatnonzero(np.abs(self.multipliers) > MULTIPLIER_TOLERANCE):
            yield int(self.point[row]), self.normals[row] * np.sign(self.multipliers[row])


NO_BOUNDS = Bounds(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros(0))


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """The optimum of one tick, in the world frame."""

    times: Vector
    """Time from the present to each sample [s], shape (N,)."""
    jerks: Matrix
    """Jerk of the CoM over each interval [m/s^3], shape (N, 2)."""
    com: Matrix
    """CoM at each sample [m], shape (N, 2)."""
    dcm: Matrix
    """Divergent component of motion at each sample [m], shape (N, 2)."""
    cop: Matrix
    """CoP at each sample [m], shape (N, 2)."""
    footholds: tuple[Footstep, ...]
    """Footholds on which some sample stands, in the order of their touchdowns."""
    stances: tuple[Stance, ...]
    """The support foot, the footholds alone, then both feet where they carry a sample side by side."""
    stance_of_sample: NDArray[np.int64]
    """Number of the stance that carries each sample, shape (N,)."""
    samples_on_support: int
    """Samples that the support foot carries alone."""
    regions: tuple[Matrix, ...]
    """Region of each foothold in the frame of the foot before it [m], shapes (V, 2)."""
    bounds: Bounds
    status: Status
    is_capturable: bool
    """Whether further steps can catch the robot where the plan ends."""
    tick_jerk: Vector | None = None
    """Jerk of the CoM over the coming tick [m/s^3], shape (2,), where it is another one than that of its interval."""
    is_continued: bool = False
    """Whether it is the plan of the tick before, which goes on because there was no time for a new one."""

    @property
    def jerk(self) -> Vector:
        """Jerk of the CoM over the coming tick [m/s^3], shape (2,)."""
        return self.jerks[0] if self.tick_jerk is None else self.tick_jerk

    @property
    def predecessors(self) -> tuple[Footstep, ...]:
        """The foot before each foothold."""
        return (self.stances[0].feet[0], *self.footholds)[: len(self.footholds)]

    @property
    def foothold_regions(self) -> tuple[Matrix, ...]:
        """Region of each foothold in the world frame [m], shapes (V, 2)."""
        return tuple(
            before.position + region @ rotation(before.yaw).T
            for before, region in zip(self.predecessors, self.regions, strict=True)
        )

    def max_leg_extension(self) -> float:
        """Largest horizontal distance from the CoM at a sample to the foot that carries it [m]."""
        feet = np.array([stance.feet[0].position for stance in self.stances])[self.stance_of_sample]
        return float(np.linalg.norm(self.com - feet, axis=1).max())

    def active_edges(self, margin: float, swing: Vector) -> Iterator[Matrix]:
        """Edges of polygons that the active bounds stand for, in the world frame [m], shapes (2, 2).

        Args:
            margin: of the CoP from the edges of its stance [m].
            swing: foot in the air [m], shape (2,): where a bound of the flight (30) begins.
        """
        N, m = len(self.times), sum(not stance.is_double_support for stance in self.stances) - 1
        inner: dict[int, Matrix] = {}
        for point, outward in self.bounds.active():
            if point == N + m:
                yield np.array([swing, self.footholds[0].position])
            elif point >= N:
                yield _edge(self.foothold_regions[point - N], outward)
            else:
                stance = int(self.stance_of_sample[point])
                if stance not in inner:
                    inner[stance] = convex_hull(inset_vertices(self.stances[stance].polygon, margin))
                yield _edge(inner[stance], outward)


def _edge(corners: Matrix, outward: Vector) -> Matrix:
    """The edge of a convex polygon, shape (V, 2), with a given outward normal; its two ends, shape (2, 2)."""
    along = corners @ outward
    return corners[np.argsort(along)[-2:]]
