"""DCM tracking with steps that move by the DCM error, after Englsberger, Ott and Albu-Schäffer 2015.

    xi' = omega (xi - z)                                                   DCM and CoP of the pendulum
    xi_ref(0) = xi_p(0) + exp(-omega T) (xi_ref(T) - xi_p(T))              reference, from the last foothold backwards
    z = z_ref + (1 + k / omega) (xi - xi_ref)                              tracking: the error shrinks as exp(-k t)
    f = f_ref + e(T) omega T_ds / (1 - exp(-omega T_ds))                   foothold, by the error e(T) at its touchdown

z_ref rests in the middle of the support foot and goes to the next one in a straight line over the double support T_ds;
the reference ends at the last foothold that counts. z is cut off at the edges of the soles that carry the robot, and f
at its region and at what the foot can still reach. While the CoP alone can mend the error by the touchdown, e(T) is
next to nothing; what the cut leaves grows as exp(omega t), and the next foothold takes it: moved by f - f_ref, its
double support moves xi_ref at the touchdown by e(T).

Source: "Three-dimensional bipedal walking control based on divergent component of motion", IEEE Transactions on
Robotics 31(2), 2015, on flat ground, where its virtual repellent point is the CoP. The text was not at hand: built from
its equations as later works cite them, Khadiv et al. 2016 (arXiv 1609.09822) among them. Heel-to-toe shift and smoothed
double supports are left out; that the error at the touchdown is predicted through the cut is ours.
"""

import math

import numpy as np

from walkcore.methods.method import Decision
from walkcore.methods.situation import ROUNDING, Interval, Situation
from walkcore.methods.trajectory import Trajectory
from walkcore.values import Matrix, Vector

TRACKING_GAIN = 4.0
"""k, rate at which a DCM error shrinks [1/s]."""
NO_ERROR = 1e-6  # [m]


class DCMTracker:
    """Follows a DCM reference by the CoP, and by the next foothold what the CoP cannot do."""

    def decide(self, now: Situation, tick: float, times: Vector) -> Decision:
        """The decision of one tick, as in `Method`."""
        reference = dcm_reference(now)
        gain = 1.0 + TRACKING_GAIN / now.omega
        error = now.dcm - reference.dcm(0.0)
        cop = now.clipped(reference.cop(tick) + gain * error, tick)
        if len(now.reachable) and not _is_nothing(error):
            growth = now.omega * now.double_support
            until_touchdown = np.array([*times[times < now.touchdown - ROUNDING], now.touchdown])
            at_touchdown = _forecast(now, reference, error, until_touchdown)[1]
            now = now.moved(at_touchdown * growth / (1.0 - math.exp(-growth)))
            reference = dcm_reference(now)
            error = now.dcm - reference.dcm(0.0)
        return Decision(cop, _forecast(now, reference, error, times)[0], now)


def dcm_reference(now: Situation) -> Trajectory:
    """The nominal CoP, and the DCM that it takes to the last foothold."""
    return Trajectory(now, [_straight(interval) for interval in now.intervals])


def _straight(interval: Interval) -> Matrix:
    """Coefficients of the CoP that goes through an interval in a straight line, shape (1, 2) or (2, 2)."""
    if math.isinf(interval.duration):
        return interval.start[None]
    return np.array([interval.start, (interval.end - interval.start) / interval.duration])


def _forecast(now: Situation, reference: Trajectory, error: Vector, times: Vector) -> tuple[Matrix, Vector]:
    """CoPs at some times [m], shape (N, 2), if the law goes on from a DCM error, and the last error [m], shape (2,)."""
    gain, before = 1.0 + TRACKING_GAIN / now.omega, 0.0
    cops = np.empty((len(times), 2))
    for k, t in enumerate(times.tolist()):
        cops[k] = reference.cop(t)
        if not _is_nothing(error):
            offset = now.clipped(cops[k] + gain * error, t) - cops[k]
            growth = math.exp(now.omega * (t - before))
            error = growth * error - (growth - 1.0) * offset
            cops[k] += offset
        before = t
    return cops, error


def _is_nothing(error: Vector) -> bool:
    x, y = error.tolist()
    return max(abs(x), abs(y)) < NO_ERROR
