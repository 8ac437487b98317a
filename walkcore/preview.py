"""What will be at the samples, as affine functions of the decision (18).

    u = (jerks_x, footholds_x, jerks_y, footholds_y)

Each quantity is a list of points of the plane; x and y have the same matrix.
"""

from dataclasses import dataclass

import numpy as np

from walkcore.lipm import CoMState, PreviewMatrices
from walkcore.regions import HalfPlanes
from walkcore.supports import Supports
from walkcore.values import Matrix, Vector

FOOTHOLD_SCALE = 1e4  # footholds in units of 10 km: the cost is almost flat along them, see qp.py


@dataclass(frozen=True, slots=True)
class Layout:
    """Where things are in u."""

    nb_samples: int
    nb_footholds: int

    @property
    def axis(self) -> int:
        """Variables of one axis."""
        return self.nb_samples + self.nb_footholds

    @property
    def scale(self) -> Vector:
        """Magnitudes of the variables for the solver, shape (2 (N + m),)."""
        return np.tile(np.repeat([1.0, FOOTHOLD_SCALE], [self.nb_samples, self.nb_footholds]), 2)

    def axes(self, u: Vector) -> Matrix:
        """The variables of x and of y side by side, shape (N + m, 2); slacks that follow u are left out."""
        return u[: 2 * self.axis].reshape(2, self.axis).T

    def jerks(self, u: Vector) -> Matrix:
        """[m/s^3], shape (N, 2)."""
        return self.axes(u)[: self.nb_samples]

    def footholds(self, u: Vector) -> Matrix:
        """[m], shape (m, 2)."""
        return self.axes(u)[self.nb_samples :]


@dataclass(frozen=True, slots=True, eq=False)
class AffinePoints:
    """Points matrix @ (u_x, u_y) + offset."""

    matrix: Matrix
    """Shape (k, N + m)."""
    offset: Matrix
    """Shape (k, 2)."""

    def at(self, axes: Matrix) -> Matrix:
        """The points for the variables of both axes, shape (N + m, 2)."""
        return self.matrix @ axes + self.offset

    def rows(self, polygons: tuple[HalfPlanes, ...]) -> tuple[Matrix, Vector, Vector]:
        """G, lower, upper that keep each point in its polygon."""
        normals = np.vstack([polygon.normals for polygon in polygons])
        point = np.repeat(np.arange(len(polygons)), [len(polygon.normals) for polygon in polygons])
        known = np.sum(normals * self.offset[point], axis=1)
        matrix = self.matrix[point]
        return (
            np.hstack([normals[:, :1] * matrix, normals[:, 1:] * matrix]),
            np.concatenate([polygon.lower for polygon in polygons]) - known,
            np.concatenate([polygon.upper for polygon in polygons]) - known,
        )

    def followed_by(self, *others: "AffinePoints") -> "AffinePoints":
        """These points and the others."""
        points = (self, *others)
        return AffinePoints(np.vstack([p.matrix for p in points]), np.vstack([p.offset for p in points]))


@dataclass(frozen=True, slots=True, eq=False)
class Preview:
    """The present, what carries the samples, and the dynamics in between."""

    com: CoMState
    supports: Supports
    lipm: PreviewMatrices

    @property
    def layout(self) -> Layout:
        """Of u."""
        return Layout(*self.supports.selection.shape)

    def _of_jerks(self, state: Matrix, jerks: Matrix) -> AffinePoints:
        """State @ x + jerks @ u, whatever the footholds are."""
        return AffinePoints(
            np.hstack([jerks, np.zeros((len(jerks), self.layout.nb_footholds))]), state @ self.com.matrix
        )

    def jerks(self) -> AffinePoints:
        """[m/s^3]."""
        N = self.layout.nb_samples
        return self._of_jerks(np.zeros((N, 3)), np.eye(N))

    def velocities(self) -> AffinePoints:
        """Of the CoM at the samples [m/s]."""
        return self._of_jerks(self.lipm.Pvs, self.lipm.Pvu)

    def mean_velocities(self, nb_samples: int) -> AffinePoints:
        """Of the CoM, over `nb_samples` samples and up to each sample that has as many before it: E of (31) [m/s]."""
        N = self.layout.nb_samples
        duration = self.lipm.times[-1] - self.lipm.times[-1 - nb_samples]
        E = (np.eye(N - nb_samples, N, nb_samples) - np.eye(N - nb_samples, N)) / duration
        return self._of_jerks(E @ self.lipm.Pps, E @ self.lipm.Ppu)

    def cops(self) -> AffinePoints:
        """Centre of pressure at each sample relative to the centre of its support, (20)-(21) [m]."""
        matrix = np.hstack([self.lipm.Pzu, -self.supports.selection])
        return AffinePoints(matrix, self.lipm.Pzs @ self.com.matrix - self.supports.known_centre)

    def dcm(self, n: int, omega: float) -> AffinePoints:
        """Divergent component of motion c + dc/omega at sample n, relative to the centre of its support [m]."""
        lipm, supports = self.lipm, self.supports
        matrix = np.concatenate([lipm.Ppu[n] + lipm.Pvu[n] / omega, -supports.selection[n]])
        offset = (lipm.Pps[n] + lipm.Pvs[n] / omega) @ self.com.matrix - supports.known_centre[n]
        return AffinePoints(matrix[None], offset[None])

    def footholds(self) -> AffinePoints:
        """[m]."""
        N, m = self.supports.selection.shape
        return AffinePoints(np.eye(m, N + m, N), np.zeros((m, 2)))

    def strides(self) -> AffinePoints:
        """From the support foot to the first foothold, and from each foothold to the next [m]."""
        N, m = self.supports.selection.shape
        offset = np.zeros((m, 2))
        offset[:1] = -self.supports.support_position
        return AffinePoints(np.hstack([np.zeros((m, N)), np.eye(m) - np.eye(m, k=-1)]), offset)

    def flight(self) -> AffinePoints:
        """From the foot in the air to the first foothold, if there is one [m]: left-hand side of (30)."""
        first = self.footholds().matrix[:1]
        return AffinePoints(first, np.tile(-self.supports.swing_position, (len(first), 1)))
