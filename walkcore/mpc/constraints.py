"""The constraints: points that are affine in u, each kept in a convex polygon.

    d . (Z - Uc f_support - U f) <= b         every CoP in the polygon of its stance          (26)-(29)
    d . (f_1 - f_support) <= b, ...           every foothold in its region                    (section 5)
    d . (f_1 - f_air) <= (t_touchdown - t) v_max    the foot in the air gets to its foothold  (30)

d are the normals of a polygon's edges and b their distances from its centre. A row of the QP is one edge of the
polygon of one point, with the opposite edge, where there is a parallel one, as its lower bound. The matrix of (28) is

    D_{k+1} | Pzu  -U   0    0 |
            |  0    0  Pzu  -U |

with D_{k+1} (29) made of the normals: no matrix product is needed for it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from walkcore.mpc.preview import FOOTHOLD_SCALE, SUPPORT, SWING, AffineMap, Preview
from walkcore.mpc.regions import HalfPlanes
from walkcore.values import Matrix, Vector


def constrained_points(preview: Preview) -> AffineMap:
    """The N CoPs beside their stances (27), the m strides (section 5), and the flight (30) if a foothold comes [m]."""
    lipm, m = preview.lipm, preview.layout.nb_free_footholds
    N = lipm.nb_samples
    cops = preview.beside_stance(lipm.Pzs, lipm.Pzu)
    points = preview.zeros(N + m + min(m, 1))
    points.D[:N], points.K[:N] = cops.D, cops.K
    if m:
        points.D[N : N + m, N:] = FOOTHOLD_SCALE * (np.eye(m) - np.eye(m, k=-1))  # from each foot to the next one
        points.K[N, SUPPORT] = -1.0
        points.D[-1, N] = FOOTHOLD_SCALE
        points.K[-1, SWING] = -1.0
    return points


def polygon_of_point(preview: Preview) -> NDArray[np.int64]:
    """Number of the polygon of each constrained point, in the order of `Supports.edges`."""
    m, beyond = preview.layout.nb_free_footholds, preview.stances.nb_stances
    return np.concatenate([preview.stances.stance_of_sample, np.arange(beyond, beyond + m + min(m, 1))])


@dataclass(frozen=True, slots=True, eq=False)
class ConstraintRows:
    """Rows lower <= G u <= upper of the QP at one tick."""

    G: Matrix
    """Shape (r, 2 (N + m))."""
    lower: Vector
    """Shape (r,), minus infinity where an edge has no parallel opposite."""
    upper: Vector
    """Shape (r,)."""
    normals: Matrix
    """Normal d of the edge of each row, shape (r, 2)."""


class Constraints:
    """Points and the polygons that keep them, whose edges may turn and move from tick to tick."""

    def __init__(self, points: AffineMap, polygon_of_point: NDArray[np.int64], nb_edges: tuple[int, ...]) -> None:
        """Lay out the rows: for each point, the edges of its polygon.

        Args:
            points: P of them.
            polygon_of_point: number of the polygon of each point, shape (P,) or shorter: the points beyond are free.
            nb_edges: rows of each polygon.
        """
        polygon_of_edge = np.repeat(np.arange(len(nb_edges)), nb_edges)
        self.point, self._edge = np.nonzero(polygon_of_point[:, None] == polygon_of_edge)
        self._D, self._K = np.asfortranarray(points.D[self.point]), points.K[self.point]

    def rows(self, edges: HalfPlanes, inputs: Matrix) -> ConstraintRows:
        """The rows of one tick (28).

        Args:
            edges: of all polygons, one below the other.
            inputs: k, shape (6 + m + N, 2).
        """
        normals = edges.normals.take(self._edge, axis=0)
        offsets = np.vecdot(normals, self._K @ inputs)
        n = self._D.shape[1]
        G = np.empty((len(offsets), 2 * n), order="F")  # as a solver likes it
        np.multiply(normals[:, :1], self._D, out=G[:, :n])
        np.multiply(normals[:, 1:], self._D, out=G[:, n:])
        lower, upper = edges.lower.take(self._edge), edges.upper.take(self._edge)
        return ConstraintRows(G, lower - offsets, upper - offsets, normals)
