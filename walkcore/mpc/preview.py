"""What will be at the samples, linear in the decision (18) and in what is known at the tick.

    points = D (u_x, u_y) + K (k_x, k_y)

    u = (jerks, footholds)
    k = (CoM state, support foot, foot in the air, from a foot to the middle of both, planned footholds, reference)

x and y have the same D and K, which depend on the phase of the gait alone: a walk needs as many of them as a
step has ticks, each computed once.
"""

from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from walkcore.mpc.gait import Horizon
from walkcore.mpc.lipm import CoMState, PreviewMatrices
from walkcore.values import Matrix, Vector

FOOTHOLD_UNIT = 1e4  # [m]: the cost is almost flat along the footholds, see qp.py


@dataclass(frozen=True, slots=True)
class Layout:
    """Where things are in u = (jerks_x, footholds_x, jerks_y, footholds_y); jerks in m/s^3, footholds in 10 km."""

    nb_samples: int
    nb_footholds: int

    @property
    def axis(self) -> int:
        """Variables of one axis."""
        return self.nb_samples + self.nb_footholds

    def axes(self, u: Vector) -> Matrix:
        """The variables of x and of y side by side, shape (N + m, 2); slacks that follow u are left out."""
        return u[: 2 * self.axis].reshape(2, self.axis).T

    def jerks(self, u: Vector) -> Matrix:
        """[m/s^3], shape (N, 2)."""
        return self.axes(u)[: self.nb_samples]

    def footholds(self, u: Vector) -> Matrix:
        """[m], shape (m, 2)."""
        return FOOTHOLD_UNIT * self.axes(u)[self.nb_samples :]


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What the QP does not decide, in the world frame."""

    com: CoMState
    support: Vector
    """Foot on the ground [m], shape (2,)."""
    swing: Vector
    """Foot in the air [m], shape (2,)."""
    to_middle: Vector
    """From the foot to the middle of both, where the feet stand side by side [m], shape (2,)."""
    planned_footholds: Matrix
    """Where a planner puts the footholds [m], shape (m, 2); meaningless where the QP is free."""
    reference: Matrix
    """CoM velocity to track at each sample [m/s], shape (N, 2)."""

    @property
    def matrix(self) -> Matrix:
        """k_x and k_y side by side, shape (6 + m + N, 2)."""
        rows = (self.support, self.swing, self.to_middle)
        return np.concatenate([self.com.matrix, rows, self.planned_footholds, self.reference])


@dataclass(frozen=True, slots=True, eq=False)
class LinearPoints:
    """Points D (u_x, u_y) + K (k_x, k_y)."""

    D: Matrix
    """Of the decision, shape (., N + m)."""
    K: Matrix
    """Of what is known, shape (., 6 + m + N)."""

    def at(self, axes: Matrix, known: Matrix) -> Matrix:
        """The points, shape (., 2), for a decision, shape (N + m, 2), and what is known, shape (6 + m + N, 2)."""
        return self.D @ axes + self.K @ known

    def followed_by(self, *others: "LinearPoints") -> "LinearPoints":
        """These points and the others."""
        points = (self, *others)
        return LinearPoints(np.vstack([p.D for p in points]), np.vstack([p.K for p in points]))


@dataclass(frozen=True, slots=True, eq=False)
class Preview:
    """The horizon at one phase of the gait: which foot carries which sample, and the dynamics in between."""

    horizon: Horizon
    lipm: PreviewMatrices
    are_footholds_free: bool
    """Whether the QP decides the footholds, or takes the planned ones."""

    @property
    def layout(self) -> Layout:
        """Of u."""
        return Layout(self.lipm.nb_samples, self.horizon.nb_footholds if self.are_footholds_free else 0)

    def jerks(self) -> LinearPoints:
        """[m/s^3]."""
        return self._points(jerks=np.eye(self.lipm.nb_samples))

    def velocity_errors(self) -> LinearPoints:
        """CoM velocity at the samples against the reference [m/s]."""
        return self._points(jerks=self.lipm.Pvu, state=self.lipm.Pvs, reference=-np.eye(self.lipm.nb_samples))

    def mean_velocity_errors(self, over: int) -> LinearPoints:
        """CoM velocity, mean over so many samples, up to each that has them, against the reference: (31) [m/s]."""
        N = self.lipm.nb_samples
        duration = self.lipm.times[-1] - self.lipm.times[-1 - over]
        E = (np.eye(N - over, N, over) - np.eye(N - over, N)) / duration
        return self._points(jerks=E @ self.lipm.Ppu, state=E @ self.lipm.Pps, reference=-np.eye(N - over, N, over))

    def cops(self) -> LinearPoints:
        """Centre of pressure at each sample relative to the centre of its support, (20)-(21) [m]."""
        return self._beside_support(slice(None), self.lipm.Pzu, self.lipm.Pzs)

    def dcm(self, n: int, omega: float) -> LinearPoints:
        """Divergent component of motion c + dc/omega at sample n, relative to the centre of its support [m]."""
        at = slice(n, n + 1 or None)
        Pxs, Pxu = (P + V / omega for P, V in ((self.lipm.Pps, self.lipm.Pvs), (self.lipm.Ppu, self.lipm.Pvu)))
        return self._beside_support(at, Pxu[at], Pxs[at])

    def foothold_errors(self) -> LinearPoints:
        """Footholds against the planned ones [m]."""
        m = self.layout.nb_footholds
        return self._points(footholds=np.eye(m), planned_footholds=-np.eye(m))

    def strides(self) -> LinearPoints:
        """From the support foot to the first foothold, and from each foothold to the next [m]."""
        m = self.layout.nb_footholds
        return self._points(footholds=np.eye(m) - np.eye(m, k=-1), support=-np.eye(m, 1))

    def flight(self) -> LinearPoints:
        """From the foot in the air to the first foothold, if there is one [m]: left-hand side of (30)."""
        m = self.layout.nb_footholds
        return self._points(footholds=np.eye(m)[:1], swing=-np.ones((min(m, 1), 1)))

    def _beside_support(self, samples: slice, jerks: Matrix, state: Matrix) -> LinearPoints:
        """Points of some samples, relative to the centres of what carries them."""
        U, Uc = self.horizon.foothold_selection[samples], self.horizon.support_selection[samples]
        footholds = {"footholds" if self.are_footholds_free else "planned_footholds": -U}
        to_middle = -self.horizon.is_on_both[samples, None].astype(float)
        return self._points(jerks=jerks, state=state, support=-Uc, to_middle=to_middle, **footholds)

    def _points(self, **blocks: Matrix) -> LinearPoints:
        """Points from blocks of columns of D and K, each named after what it multiplies; the others are zero."""
        rows, (N, m) = len(next(iter(blocks.values()))), (self.lipm.nb_samples, self.horizon.nb_footholds)
        decided = {"jerks": N, "footholds": self.layout.nb_footholds}
        known = {"state": 3, "support": 1, "swing": 1, "to_middle": 1, "planned_footholds": m, "reference": N}
        D, K = np.zeros((rows, sum(decided.values()))), np.zeros((rows, sum(known.values())))
        for matrix, widths in ((D, decided), (K, known)):
            ends = accumulate(widths.values())
            for (name, width), end in zip(widths.items(), ends, strict=True):
                if name in blocks:
                    matrix[:, end - width : end] = blocks[name]
        D[:, N:] *= FOOTHOLD_UNIT
        return LinearPoints(D, K)
