"""Points of the horizon, affine in the decision u (18) and in the inputs k of the QP.

    points = D (u_x, u_y) + K (k_x, k_y)

    u = (jerks, footholds)
    k = (CoM state, support foot, foot in the air, from a foot to the middle of both, planned footholds, reference)

x and y have the same D and K, which depend on the phase of the gait alone.
"""

from dataclasses import dataclass, field

import numpy as np

from walkcore.mpc.horizon import StanceSequence
from walkcore.mpc.lipm import CoMState, PreviewMatrices
from walkcore.values import Matrix, Vector

FOOTHOLD_SCALE = 1e4  # the cost is almost flat along the footholds, see qp.py: u holds them divided by this


@dataclass(frozen=True, slots=True)
class Layout:
    """Index ranges of u = (jerks_x, footholds_x, jerks_y, footholds_y) and of k."""

    nb_samples: int
    """N."""
    nb_footholds: int
    """m, on which samples stand."""
    has_foothold_variables: bool
    """Whether the footholds are variables of the QP, or the planned ones are taken."""

    @property
    def nb_free_footholds(self) -> int:
        """Footholds that are variables of the QP."""
        return self.nb_footholds if self.has_foothold_variables else 0

    @property
    def axis(self) -> int:
        """Number of variables of one axis."""
        return self.nb_samples + self.nb_free_footholds

    def split(self, u: Vector) -> tuple[Matrix, Matrix]:
        """Jerks [m/s^3], shape (N, 2), and footholds [m], shape (m, 2), in the world frame.

        Args:
            u: solution of the QP; slacks that follow its first 2 (N + m) numbers are left out.
        """
        axes = u[: 2 * self.axis].reshape(2, self.axis).T
        return np.ascontiguousarray(axes[: self.nb_samples]), FOOTHOLD_SCALE * axes[self.nb_samples :]


@dataclass(frozen=True, slots=True, eq=False)
class QPInputs:
    """The quantities of a tick that the QP does not decide, in the world frame: k."""

    com: CoMState
    support: Vector
    """Foot on the ground [m], shape (2,)."""
    swing: Vector
    """Foot in the air [m], shape (2,)."""
    to_middle: Vector
    """Offset from the foot to the middle of both, where the feet stand side by side [m], shape (2,)."""
    planned_footholds: Matrix
    """Footholds of a planner [m], shape (m, 2); meaningless where the QP is free."""
    reference: Matrix
    """CoM velocity to track at each sample [m/s], shape (N, 2)."""

    @property
    def matrix(self) -> Matrix:
        """k_x and k_y side by side, shape (6 + m + N, 2)."""
        rows = (self.support, self.swing, self.to_middle)
        return np.concatenate([self.com.matrix, rows, self.planned_footholds, self.reference])


# Columns of K by their place in k; the m planned footholds and the N references follow.
STATE, SUPPORT, SWING, TO_MIDDLE, PLANNED = slice(0, 3), slice(3, 4), slice(4, 5), slice(5, 6), 6


@dataclass(frozen=True, slots=True, eq=False)
class AffineMap:
    """Points D (u_x, u_y) + K (k_x, k_y)."""

    D: Matrix
    """Decision to points, shape (., N + m)."""
    K: Matrix
    """Inputs to points, shape (., 6 + m + N)."""


@dataclass(frozen=True, slots=True, eq=False)
class Preview:
    """The horizon at one tick: which stance carries which sample, and the dynamics in between."""

    stances: StanceSequence
    lipm: PreviewMatrices
    samples_per_step: int
    has_foothold_variables: bool
    """Whether the footholds are variables of the QP, or the planned ones are taken."""
    layout: Layout = field(init=False)
    """Layout of u and k."""

    def __post_init__(self) -> None:
        layout = Layout(self.lipm.nb_samples, self.stances.nb_footholds, self.has_foothold_variables)
        object.__setattr__(self, "layout", layout)

    def zeros(self, nb_points: int) -> AffineMap:
        """A map of so many points to the origin, to be filled."""
        layout = self.layout
        nb_inputs = PLANNED + layout.nb_footholds + layout.nb_samples
        return AffineMap(np.zeros((nb_points, layout.axis)), np.zeros((nb_points, nb_inputs)))

    def beside_stance(self, Pxs: Matrix, Pxu: Matrix, samples: slice = slice(None)) -> AffineMap:
        """Points Pxs x + Pxu u of the samples, relative to the centres of their stances (20)-(21).

        Args:
            Pxs: from the state of the CoM to the points, shape (N, 3).
            Pxu: from the jerks to the points, shape (N, N).
            samples: that are taken; all by default.
        """
        N, stances = self.lipm.nb_samples, self.stances
        points = self.zeros(len(Pxs[samples]))
        points.D[:, :N] = Pxu[samples]
        points.K[:, STATE] = Pxs[samples]
        points.K[:, SUPPORT] = -stances.Uc[samples]
        points.K[:, TO_MIDDLE] = -stances.is_double_support[samples, None].astype(float)
        if self.has_foothold_variables:
            points.D[:, N:] = -FOOTHOLD_SCALE * stances.U[samples]
        else:
            points.K[:, PLANNED : PLANNED + stances.nb_footholds] = -stances.U[samples]
        return points
