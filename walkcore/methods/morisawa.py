"""Analytic CoM and ZMP trajectories with immediate modification of the foot place, after Morisawa et al. 2007 [11].

    z(t) = a_0 + a_1 t + ... + a_n t^n                                                 ZMP over each interval
    c(t) = c_p(t) + V cosh(omega t) + W sinh(omega t),  c_p = z + d2z / omega^2 + ...    CoM over the same interval

The footholds are decided beforehand. The ZMP rests in the middle of the foot over a single support, and goes to the
next one by a cubic with flat ends over a double support. V and W of the first interval are fixed by the present CoM,
which cannot jump, and those of the others by continuity; for the CoM to stay with the ZMP, its growing part has to be

    c + dc / omega = xi = omega int_0^inf exp(-omega t) z(t) dt

and that fixes one more coefficient: until the end T of the first single support ahead, the ZMP is

    z(t) = nominal ZMP + (d + s t) (1 - t / T)^2,

d away from it at the present, where it cannot jump either, back on it with the same slope at T, and with s for xi to
fit.

Whatever changes, the footholds by the reference or the CoM by a push, all is solved again at once, and the ZMP swings
out to pay for it: the "ZMP fluctuation". How far it goes is not in the method's hands. Where it would leave the sole,
the foot place is modified at once: all coming footholds move by as much as brings the worst excursion of the ZMP back
to the edge.

Source: "Experimentation of humanoid walking allowing immediate modification of foot place based on analytical
solution", ICRA 2007, pages 3989-3994. The text was not at hand: built from the comments of
`AnalyticalMorisawaCompact` in jrl-walkgen, which says that it follows that paper (degree 4 in the first and the last
interval, 3 in between). Ours are: footholds that go on where the paper's last interval ends at rest, so that one
condition on xi, and one coefficient less, take the place of those at its end; that the rest of a double support
counts to the first interval; that the ZMP is cut off at the soles; and the modification for a push, where the paper
leaves the foot place to whoever commands it. The paper's change of the step's duration is left out.
"""

import math

import numpy as np

from walkcore.methods.method import Decision
from walkcore.methods.situation import ROUNDING, Interval, Situation
from walkcore.methods.trajectory import Trajectory, particular
from walkcore.values import Matrix, Vector

RETURN = 0.7
"""T of a robot that stands [s]."""
NB_CHECKED = 10
"""Times up to T at which the ZMP is held against the soles."""
POWERS = np.arange(4)
SMOOTH_STEP = np.array([0.0, 0.0, 3.0, -2.0])
"""Coefficients of the cubic from 0 to 1 with flat ends."""


class Morisawa:
    """Follows analytic trajectories, solved again at each tick."""

    def decide(self, now: Situation, tick: float, times: Vector) -> Decision:
        """The decision of one tick, as in `Method`."""
        plan, moved = AnalyticPlan(now), now
        if len(now.reachable):
            shift = plan.modification()
            if np.any(shift):
                moved = now.moved(shift)
                plan = AnalyticPlan(moved)
        cops = np.array([moved.clipped(plan.cop(t), t) for t in times.tolist()])
        return Decision(moved.clipped(plan.cop(tick), tick), cops, moved)


class AnalyticPlan:
    """The ZMP from now on, by which the DCM at the present is the one of the CoM."""

    def __init__(self, now: Situation) -> None:
        """Solve for the free coefficient.

        Args:
            now: the situation.
        """
        self._now, omega = now, now.omega
        self._nominal = Trajectory(now, [_under_way(now), *map(_smooth, now.intervals[1:])])
        if not math.isfinite(now.touchdown):
            end = RETURN
        else:  # of a robot that stands before its first step, before that
            waits = now.lift_off > now.double_support + ROUNDING
            end = now.lift_off - now.double_support if waits else now.touchdown
        away = now.pendulum.cop(now.com) - self._nominal.cop(0.0)
        parabola, bump = (
            np.array([1.0, -2.0, 1.0, 0.0]) / end**POWERS,
            np.array([0.0, 1.0, -2.0, 1.0]) / end ** (POWERS - 1),
        )
        missing = now.dcm - self._nominal.dcm(0.0) - away * _dcm_before(parabola, end, 0.0, omega)
        self._per_slope = _dcm_before(bump, end, 0.0, omega)
        self._bump, self._end = bump, end
        self._fluctuation = np.outer(parabola, away) + np.outer(bump, missing / self._per_slope)

    def cop(self, t: float) -> Vector:
        """ZMP [m], shape (2,).

        Args:
            t: from now [s].
        """
        nominal = self._nominal.cop(t)
        return nominal + t**POWERS @ self._fluctuation if t < self._end else nominal

    def dcm(self, t: float) -> Vector:
        """DCM [m], shape (2,).

        Args:
            t: from now [s].
        """
        nominal, omega, end = self._nominal.dcm(t), self._now.omega, self._end
        if t >= end:
            return nominal
        xi_p = particular(4, omega) @ self._fluctuation
        return nominal + t**POWERS @ xi_p - math.exp(-omega * (end - t)) * (end**POWERS @ xi_p)

    def modification(self) -> Vector:
        """The shift of all coming footholds that brings the ZMP back to the edges of the soles [m], shape (2,)."""
        now, worst, most = self._now, np.zeros(2), 0.0
        for t in np.linspace(0.0, min(self._end, now.touchdown), NB_CHECKED + 2)[1:-1].tolist():
            cop = self.cop(t)
            excess = (cop - now.clipped(cop, t)) / (self._bump @ t**POWERS)
            if (size := math.hypot(*excess.tolist())) > most:
                worst, most = excess, size
        step = SMOOTH_STEP / now.double_support**POWERS
        before_step = math.exp(-now.omega * now.touchdown)
        return worst * self._per_slope / (before_step * _dcm_before(step, now.double_support, 1.0, now.omega))


def _under_way(now: Situation) -> Matrix:
    """Coefficients of the nominal ZMP for the rest of the present interval, shape (n, 2)."""
    interval = now.intervals[0]
    passed = 1.0 - interval.duration / now.double_support
    if len(interval.feet) == 1 or passed < 0.0:
        return _smooth(interval)
    s = passed  # of 1 - 3 s^2 + 2 s^3, the way that is left from the foot behind
    left = np.array([1.0 - 3.0 * s**2 + 2.0 * s**3, -6.0 * s * (1.0 - s), 6.0 * s - 3.0, 2.0])
    polynomial = np.outer(left / now.double_support**POWERS, now.swing.position - interval.end)
    polynomial[0] += interval.end
    return polynomial


def _smooth(interval: Interval) -> Matrix:
    """Coefficients of the nominal ZMP of an interval, shape (1, 2) or (4, 2)."""
    if math.isinf(interval.duration) or interval.start is interval.end:
        return interval.start[None]
    polynomial = np.outer(SMOOTH_STEP / interval.duration**POWERS, interval.end - interval.start)
    polynomial[0] += interval.start
    return polynomial


def _dcm_before(polynomial: Vector, duration: float, after: float, omega: float) -> float:
    """The DCM along one axis at the beginning of an interval.

    Args:
        polynomial: coefficients of the CoP by powers of time, shape (4,).
        duration: of the interval [s].
        after: DCM at its end.
        omega: of the pendulum [1/s].
    """
    xi_p = particular(4, omega) @ polynomial
    return float(xi_p[0] + math.exp(-omega * duration) * (after - duration**POWERS @ xi_p))
