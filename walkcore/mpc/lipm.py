"""Preview of the linear inverted pendulum over N samples.

    C   = Pps x + Ppu u      CoM positions           [m]      (7)
    dC  = Pvs x + Pvu u      CoM velocities          [m/s]    (8)
    Z   = Pzs x + Pzu u      centres of pressure     [m]      (9)

with x = (c, dc, ddc) at the present and u the N jerks, each constant over one
interval. The same matrices serve both axes. The paper's intervals all last T;
here the first may be shorter, so that the QP can be solved again between two
samples of the gait's grid. Notation: Herdt et al. 2010.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from walkcore.values import Matrix, Vector, freeze, frozen_copy

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True, slots=True, eq=False)
class CoMState:
    """Horizontal state of the centre of mass in the world frame."""

    matrix: Matrix
    """(c, dc, ddc) of both axes side by side [m], [m/s], [m/s^2], shape (3, 2): the x of (3) and its y."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", frozen_copy(self.matrix, shape=(3, 2)))

    @classmethod
    def at_rest(cls, position: Vector) -> "CoMState":
        """The CoM at rest.

        Args:
            position: in the world frame [m], shape (2,).
        """
        return cls(np.array([position, np.zeros(2), np.zeros(2)]))

    @property
    def position(self) -> Vector:
        """Position c [m], shape (2,)."""
        return self.matrix[0]

    @property
    def velocity(self) -> Vector:
        """Velocity dc [m/s], shape (2,)."""
        return self.matrix[1]

    @property
    def acceleration(self) -> Vector:
        """Acceleration ddc [m/s^2], shape (2,)."""
        return self.matrix[2]

    def pushed(self, velocity_change: Vector) -> "CoMState":
        """The state after an impulse: only the velocity jumps.

        Args:
            velocity_change: impulse over mass, world frame [m/s], shape (2,).
        """
        return CoMState(np.array([self.position, self.velocity + velocity_change, self.acceleration]))

    def integrated(self, jerk: Vector, duration: float) -> "CoMState":
        """The state after a constant jerk: (1)-(4).

        Args:
            jerk: in the world frame [m/s^3], shape (2,).
            duration: [s].
        """
        A, B = _transition(duration)
        return CoMState(freeze(A @ self.matrix + B * jerk))


@lru_cache(maxsize=16)  # a walk has one control period
def _transition(T: float) -> tuple[Matrix, Matrix]:
    """A and B of (4), shapes (3, 3) and (3, 1)."""
    A = np.array([[1.0, T, T**2 / 2], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    B = np.array([[T**3 / 6], [T**2 / 2], [T]])
    return frozen_copy(A), frozen_copy(B)


@dataclass(frozen=True)
class Pendulum:
    """Linear inverted pendulum: a point mass at a constant height above its centre of pressure."""

    height: float
    """h, of the CoM above the ground [m]."""
    gravity: float = GRAVITY
    """g [m/s^2]."""

    @cached_property
    def omega(self) -> float:
        """Natural frequency sqrt(g/h) [1/s]."""
        return math.sqrt(self.gravity / self.height)

    def cop(self, com: CoMState) -> Vector:
        """Centre of pressure c - h/g ddc, (5)-(6), in the world frame [m], shape (2,)."""
        return com.position - self.height / self.gravity * com.acceleration

    def dcm(self, com: CoMState) -> Vector:
        """Divergent component of motion c + dc/omega in the world frame [m], shape (2,)."""
        return com.position + com.velocity / self.omega


@dataclass(frozen=True, slots=True, eq=False)
class PreviewMatrices:
    """The matrices of (7)-(9) for one axis, and the times of the samples."""

    times: Vector
    """Time from the present to each sample [s], shape (N,)."""
    Pps: Matrix
    """State to CoM positions, shape (N, 3)."""
    Ppu: Matrix
    """Jerks to CoM positions, shape (N, N)."""
    Pvs: Matrix
    """State to CoM velocities, shape (N, 3)."""
    Pvu: Matrix
    """Jerks to CoM velocities, shape (N, N)."""
    Pzs: Matrix
    """State to centres of pressure, shape (N, 3)."""
    Pzu: Matrix
    """Jerks to centres of pressure, shape (N, N)."""
    Pds: Matrix
    """State to DCMs, Pps + Pvs / omega, shape (N, 3)."""
    Pdu: Matrix
    """Jerks to DCMs, Ppu + Pvu / omega, shape (N, N)."""
    P: Matrix = field(init=False, repr=False)
    """State and jerks to CoM positions, DCMs and CoPs, one below the other, shape (3 N, 3 + N)."""

    def __post_init__(self) -> None:
        P = np.block([[self.Pps, self.Ppu], [self.Pds, self.Pdu], [self.Pzs, self.Pzu]])
        object.__setattr__(self, "P", freeze(P))

    @property
    def nb_samples(self) -> int:
        """N, number of samples."""
        return len(self.times)

    def trajectories(self, com: CoMState, jerks: Matrix) -> tuple[Matrix, Matrix, Matrix]:
        """CoM positions, DCMs and CoPs at the samples, world frame [m], shapes (N, 2).

        Args:
            com: at the present.
            jerks: over each interval [m/s^3], shape (N, 2).
        """
        points = freeze(self.P @ np.concatenate((com.matrix, jerks)))
        N = self.nb_samples
        return points[:N], points[N : 2 * N], points[2 * N :]


def preview_matrices(intervals: Vector, pendulum: Pendulum) -> PreviewMatrices:
    """Preview over intervals of constant jerk.

    A jerk that acts from s to e is felt at a later time t as ((t-s)^3 - (t-e)^3)/6 in
    position, ((t-s)^2 - (t-e)^2)/2 in velocity and (e-s) in acceleration. With all
    intervals equal to T these are the matrices printed after (10), in whose last rows N has to read N - 1.

    Args:
        intervals: durations between samples [s], shape (N,), positive.
        pendulum: whose CoM moves.
    """
    t = np.cumsum(intervals)
    one, zero = np.ones_like(t), np.zeros_like(t)
    since_start = np.maximum(t[:, None] - (t - intervals)[None, :], 0.0)
    since_end = np.maximum(t[:, None] - t[None, :], 0.0)

    Pps, Ppu = np.column_stack([one, t, t**2 / 2]), (since_start**3 - since_end**3) / 6
    Pvs, Pvu = np.column_stack([zero, one, t]), (since_start**2 - since_end**2) / 2
    Pas, Pau = np.column_stack([zero, zero, one]), since_start - since_end

    h, g, omega = pendulum.height, pendulum.gravity, pendulum.omega
    Pzs, Pzu = Pps - h / g * Pas, Ppu - h / g * Pau
    Pds, Pdu = Pps + Pvs / omega, Ppu + Pvu / omega
    return PreviewMatrices(*(frozen_copy(matrix) for matrix in (t, Pps, Ppu, Pvs, Pvu, Pzs, Pzu, Pds, Pdu)))


@lru_cache(maxsize=128)  # other parameters leave them as they are, and each tick of a step has its own
def tick_preview(nb_samples: int, period: float, time_to_sample: float, pendulum: Pendulum) -> PreviewMatrices:
    """Preview at a tick between two samples: the first interval ends at the next sample of the gait's grid.

    Args:
        nb_samples: N.
        period: T, between samples [s].
        time_to_sample: from the tick to the first sample [s], at most T.
        pendulum: whose CoM moves.
    """
    intervals = np.full(nb_samples, period)
    intervals[0] = time_to_sample
    return preview_matrices(intervals, pendulum)
