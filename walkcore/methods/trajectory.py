"""CoPs that are polynomials of time over the coming intervals, and the DCM that goes with them.

    xi' = omega (xi - z),    xi = c + dc / omega                                the DCM and the CoP z

Over an interval in which z is a polynomial of time, xi_p = z + dz / omega + ddz / omega^2 + ... is a solution, and

    xi(0) = xi_p(0) + exp(-omega T) (xi(T) - xi_p(T))                           the DCM before, from the one after

holds for every other one. Backwards that forgets: what is beyond a few steps does not count.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from walkcore.methods.situation import Situation
from walkcore.values import Matrix, Vector, frozen_copy


class Trajectory:
    """CoPs that are polynomials of time over the intervals of a situation, and the DCM that goes with them."""

    def __init__(self, now: Situation, polynomials: Sequence[Matrix]) -> None:
        """Go backwards from the last interval, at whose end the DCM is on the CoP.

        Args:
            now: the situation.
            polynomials: of the CoP in each interval, coefficients by powers of the time since it began, shapes (n, 2).
        """
        self._now, self._cops = now, polynomials
        self._particular = [particular(len(c), now.omega) @ c for c in polynomials]
        dcm, rests = now.intervals[-1].end, list[Vector]()
        for interval, xi_p in zip(reversed(now.intervals), reversed(self._particular), strict=True):
            is_for_ever = math.isinf(interval.duration)
            rest = np.zeros(2) if is_for_ever else dcm - _value(xi_p, interval.duration)
            rests.append(rest if is_for_ever else math.exp(-now.omega * interval.duration) * rest)
            dcm = xi_p[0] + rests[-1]
        self._rests = rests[::-1]  # xi - xi_p at the beginning of each interval

    def cop(self, t: float) -> Vector:
        """CoP [m], shape (2,).

        Args:
            t: from now [s].
        """
        k, since = self._now.at(t)
        return _value(self._cops[k], since)

    def dcm(self, t: float) -> Vector:
        """DCM [m], shape (2,).

        Args:
            t: from now [s].
        """
        k, since = self._now.at(t)
        return _value(self._particular[k], since) + math.exp(self._now.omega * since) * self._rests[k]


def _value(polynomial: Matrix, t: float) -> Vector:
    value = polynomial[-1]
    for coefficient in polynomial[-2::-1]:  # by Horner
        value = value * t + coefficient
    return value


@lru_cache(maxsize=16)
def particular(nb_coefficients: int, omega: float) -> Matrix:
    """Map from the coefficients of the CoP to those of xi_p, shape (n, n).

    Args:
        nb_coefficients: n.
        omega: of the pendulum [1/s].
    """
    derivative = np.diag(np.arange(1.0, nb_coefficients), 1) / omega
    return frozen_copy(sum((np.linalg.matrix_power(derivative, k) for k in range(nb_coefficients)), np.zeros(1)))
