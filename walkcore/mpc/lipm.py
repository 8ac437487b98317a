"""Preview of the linear inverted pendulum over N samples.

    C   = Pps x + Ppu u      CoM positions           [m]      (7)
    dC  = Pvs x + Pvu u      CoM velocities          [m/s]    (8)
    Z   = Pzs x + Pzu u      centres of pressure     [m]      (9)

with x = (c, dc, ddc) at the present and u the N jerks, each constant over one
interval. The same matrices serve both axes. The paper's intervals all last T;
here the first may be shorter, so that the QP can be solved again between two
samples of the gait's grid. Notation: Herdt et al. 2010.
"""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from walkcore.values import Matrix, Vector, read_only

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True, slots=True, eq=False)
class CoMState:
    """Horizontal state of the centre of mass in the world frame."""

    position: Vector
    """[m], shape (2,)."""
    velocity: Vector
    """[m/s], shape (2,)."""
    acceleration: Vector
    """[m/s^2], shape (2,)."""
    matrix: Matrix = field(init=False, repr=False)
    """(c, dc, ddc) of both axes side by side, shape (3, 2): the x of (3) and its y."""

    def __post_init__(self) -> None:
        matrix = read_only((self.position, self.velocity, self.acceleration), shape=(3, 2))
        object.__setattr__(self, "matrix", matrix)
        for name, row in zip(("position", "velocity", "acceleration"), matrix, strict=True):
            object.__setattr__(self, name, row)

    def cop(self, height: float, gravity: float) -> Vector:
        """Centre of pressure of the model (5)-(6) in the world frame [m], shape (2,)."""
        return self.position - height / gravity * self.acceleration

    def pushed(self, velocity_change: Vector) -> "CoMState":
        """The state after an impulse: only the velocity jumps, by `velocity_change` [m/s], shape (2,)."""
        return CoMState(self.position, self.velocity + velocity_change, self.acceleration)

    def integrated(self, jerk: Vector, duration: float) -> "CoMState":
        """The state after a constant `jerk` [m/s^3], shape (2,), over `duration` [s]: (1)-(4)."""
        A, B = _transition(duration)
        return CoMState(*(A @ self.matrix + B * jerk))


@lru_cache(maxsize=16)  # a walk has one control period
def _transition(T: float) -> tuple[Matrix, Matrix]:
    """A and B of (4), shapes (3, 3) and (3, 1)."""
    A = np.array([[1.0, T, T**2 / 2], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    B = np.array([[T**3 / 6], [T**2 / 2], [T]])
    return read_only(A), read_only(B)


@dataclass(frozen=True, slots=True, eq=False)
class PreviewMatrices:
    """The matrices of (7)-(9) for one axis, and the times of the samples."""

    times: Vector
    """From the present to each sample [s], shape (N,)."""
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

    @property
    def nb_samples(self) -> int:
        """N."""
        return len(self.times)


def preview_matrices(intervals: Vector, height: float, gravity: float = GRAVITY) -> PreviewMatrices:
    """Preview over intervals of constant jerk.

    A jerk that acts from s to e is felt at a later time t as ((t-s)^3 - (t-e)^3)/6 in
    position, ((t-s)^2 - (t-e)^2)/2 in velocity and (e-s) in acceleration. With all
    intervals equal to T these are the matrices printed after (10).

    Args:
        intervals: durations between samples [s], shape (N,), positive.
        height: of the CoM above the ground [m].
        gravity: [m/s^2].
    """
    t = np.cumsum(intervals)
    one, zero = np.ones_like(t), np.zeros_like(t)
    since_start = np.maximum(t[:, None] - (t - intervals)[None, :], 0.0)
    since_end = np.maximum(t[:, None] - t[None, :], 0.0)

    Pps, Ppu = np.column_stack([one, t, t**2 / 2]), (since_start**3 - since_end**3) / 6
    Pvs, Pvu = np.column_stack([zero, one, t]), (since_start**2 - since_end**2) / 2
    Pas, Pau = np.column_stack([zero, zero, one]), since_start - since_end

    Pzs, Pzu = Pps - height / gravity * Pas, Ppu - height / gravity * Pau
    return PreviewMatrices(*(read_only(matrix) for matrix in (t, Pps, Ppu, Pvs, Pvu, Pzs, Pzu)))
