"""The objective: a sum of weight/2 || residual ||^2, of which each scheme takes some terms.

    jerk           u                                              alpha       (19)
    velocity       Pvu u + Pvs x - dC_ref                         beta        (17), (19)
    cop            Pzu u - U f + Pzs x - Uc f_support             gamma       (19); in (11) cop_tracking
    mean_velocity  E (Ppu u + Pps x) / (2 T_step) - dC_ref        delta       (31)
    foothold       f - f_planned                                  foothold_weight   (our addition, after [1])

Each residual is D u + K k, see `preview`, so the sum is 1/2 u^T Q' u + (J k)^T u with

    Q' = sum weight D^T D,    J = sum weight D^T K.

For the terms of (19) these are the paper's, but for the rows and columns of the footholds, which are times
`FOOTHOLD_SCALE`:

    Q'_k = | alpha I + beta Pvu^T Pvu + gamma Pzu^T Pzu    -gamma Pzu^T U |   (24)
           | -gamma U^T Pzu                                 gamma U^T U   |

    p_k  = | beta Pvu^T (Pvs x - dC_ref) + gamma Pzu^T (Pzs x - Uc f_support) |   (25)
           | -gamma U^T (Pzs x - Uc f_support)                                |

Where both feet carry a sample, the middle between them takes the place of f_support.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from walkcore.mpc.preview import FOOTHOLD_SCALE, PLANNED, STATE, AffineMap, Preview
from walkcore.values import Matrix


class Weights(Protocol):
    """Weights of the terms, as `Parameters` has them."""

    @property
    def alpha(self) -> float:
        """Weight of the jerk."""
        ...

    @property
    def beta(self) -> float:
        """Weight of the velocity error."""
        ...

    @property
    def gamma(self) -> float:
        """Weight of the distance from the CoP to the centre of its stance in (19)."""
        ...

    @property
    def delta(self) -> float:
        """Weight of the error of the mean velocity."""
        ...

    @property
    def cop_tracking(self) -> float:
        """The same as gamma in (11), where nothing else drives the motion."""
        ...

    @property
    def foothold_weight(self) -> float:
        """Weight of the distance from the footholds to the planned ones."""
        ...


@dataclass(frozen=True, slots=True)
class Term:
    """One term weight/2 || residual ||^2 of the objective."""

    weight: float
    residual: Callable[[Preview], AffineMap]


def jerk(preview: Preview) -> AffineMap:
    """Jerks u [m/s^3]."""
    N = preview.lipm.nb_samples
    residual = preview.zeros(N)
    residual.D[:, :N] = np.eye(N)
    return residual


def velocity(preview: Preview) -> AffineMap:
    """CoM velocity at the samples against the reference, Pvu u + Pvs x - dC_ref [m/s]."""
    Pvs, Pvu, N = preview.lipm.Pvs, preview.lipm.Pvu, preview.lipm.nb_samples
    residual = preview.zeros(N)
    residual.D[:, :N] = Pvu
    residual.K[:, STATE] = Pvs
    residual.K[:, -N:] = -np.eye(N)
    return residual


def cop(preview: Preview) -> AffineMap:
    """CoP at the samples against the centres of their stances, Pzu u - U f + Pzs x - Uc f_support [m]."""
    return preview.beside_stance(preview.lipm.Pzs, preview.lipm.Pzu)


def mean_velocity(preview: Preview) -> AffineMap:
    """Mean CoM velocity over two steps, up to each sample that has them, against the reference (31) [m/s]."""
    Pps, Ppu, N = preview.lipm.Pps, preview.lipm.Ppu, preview.lipm.nb_samples
    over = 2 * preview.samples_per_step
    duration = preview.lipm.times[-1] - preview.lipm.times[-1 - over]  # 2 T_step
    E = (np.eye(N - over, N, over) - np.eye(N - over, N)) / duration
    residual = preview.zeros(N - over)
    residual.D[:, :N] = E @ Ppu
    residual.K[:, STATE] = E @ Pps
    residual.K[:, -N:] = -np.eye(N - over, N, over)
    return residual


def foothold(preview: Preview) -> AffineMap:
    """Footholds against the planned ones, f - f_planned [m]."""
    m = preview.layout.nb_free_footholds
    residual = preview.zeros(m)
    residual.D[:, preview.lipm.nb_samples :] = FOOTHOLD_SCALE * np.eye(m)
    residual.K[:, PLANNED : PLANNED + m] = -np.eye(m)
    return residual


def objective(terms: Sequence[Term], preview: Preview) -> tuple[Matrix, Matrix]:
    """Q' of (23)-(24), shape (N + m, N + m), and J of p_k = J k (25), shape (N + m, 6 + m + N), of one axis."""
    total = preview.zeros(preview.layout.axis)
    Q, J = total.D, total.K
    for term in terms:
        residual = term.residual(preview)
        weighted = term.weight * residual.D.T
        Q[:] += weighted @ residual.D
        J[:] += weighted @ residual.K
    return Q, J
