"""A saturated regulator of the CoM that places feet where the CoP saturates, after Sugihara 2008 [16].

    ddc = omega^2 (c - z)
    z* = z_d + (1 + q_1 q_2) (c - c_d) + (q_1 + q_2) (dc - dc_d) / omega            poles at -q_1 omega and -q_2 omega
    z = z*, cut off at the soles;    f moves by what z* at the touchdown is beyond the sole of the planned foothold

The goal c_d of a step is the pendulum's own arc over the middle z_d of its foot, from halfway between the feet to
halfway between the next ones in the time T of a step:

    c_d = f - s w / 2 cosh(omega t) / cosh(omega T / 2)                      across, t from the middle of the step
    c_d = f + v T / 2 sinh(omega t) / sinh(omega T / 2)                      along

The CoP is first cut off a margin inside of the soles, as in every other scheme; where the foothold that would have to
make up for that cannot be had, at their edges. With both poles at -omega, z* depends on the DCM alone. Neither
feasibility nor stability of the footholds is looked at: the gain 1 + q_1 q_2 overestimates the step that is needed,
and errors of the DCM change their sign from step to step.

Source: "Simulated regulator to synthesize ZMP manipulation and foot location for autonomous control of biped robots",
ICRA 2008, pages 1264-1269. The text was not at hand: built from the description in section 1 of Herdt et al. 2010, "a
saturated PD regulator of the motion of the CoM, the saturation being used to satisfy the constraints on the CoP and
generate the foot step placements accordingly when required", with q_1 = q_2 = 1, which the same author's "best COM-
ZMP regulator" of ICRA 2009 has. Ours are: the arcs, since the gait is on schedule here; and that z* is foreseen at
the touchdown.
"""

import math

import numpy as np

from walkcore.methods.method import Decision
from walkcore.methods.situation import ROUNDING, Situation
from walkcore.mpc.regions import nearest_within
from walkcore.values import Matrix, Vector, rotation

POLES = (1.0, 1.0)
"""q_1 and q_2."""
LEAST_SHIFT = 1e-6
"""Difference below which a foothold is where it should be [m]."""


class Sugihara:
    """Pulls the CoM to a moving goal by the CoP, and puts feet where that saturates."""

    def decide(self, now: Situation, tick: float, times: Vector) -> Decision:
        """The decision of one tick, as in `Method`."""
        moved, is_enough = now, True
        if len(now.reachable):
            until_touchdown = np.array([*times[times < now.touchdown - ROUNDING], now.touchdown])
            _, com = _forecast(now, until_touchdown)
            wanted = regulated_cop(now, com, now.touchdown, is_landed=True)
            shift = wanted - nearest_within(now.inner_sole_of(now.footholds[0]), wanted)
            moved = now.moved(shift)
            granted = moved.footholds[0].position - now.footholds[0].position
            is_enough = float(np.abs(shift - granted).max()) < LEAST_SHIFT
        wanted = regulated_cop(now, now.com.matrix[:2], 0.0)
        cop = now.clipped_inside(wanted, tick) if is_enough else now.clipped(wanted, tick)
        return Decision(cop, _forecast(moved, times)[0], moved)


def goal(now: Situation, t: float, *, is_landed: bool = False) -> Matrix:
    """The goal of the regulator: z_d [m], c_d [m] and dc_d [m/s], shape (3, 2).

    Args:
        now: the situation.
        t: from now [s].
        is_landed: whether that is at the next touchdown, and the foothold carries the robot already.
    """
    k, _ = now.at(t)
    waits = now.lift_off > now.double_support + ROUNDING
    if is_landed:
        k = (3 if waits else 2) if now.lift_off > ROUNDING else 1
    interval, nothing = now.intervals[k], np.zeros(2)
    if math.isinf(interval.duration):
        return np.array([interval.end, interval.end, nothing])
    foot, omega, duration = interval.feet[0], now.omega, now.double_support + now.single_support
    beside = rotation(foot.yaw) @ np.array([0.0, -foot.side.sign * now.stance_width / 2.0])
    half = omega * duration / 2.0
    if waits and k == 0:  # at rest where the DCM of the first arc begins
        start = foot.position + beside * (1.0 - math.tanh(half))
        return np.array([start, start, nothing])
    stride = nothing if now.is_stopping else (now.footholds[1].position - now.support.position) / 2.0
    middle_of_step = now.touchdown - duration / 2.0
    if foot is not now.support:
        middle_of_step += duration * (1 + now.footholds.index(foot))
    c, s = math.cosh(omega * (t - middle_of_step)), math.sinh(omega * (t - middle_of_step))
    across, along = beside / math.cosh(half), stride / (2.0 * math.sinh(half))
    return np.array([foot.position, foot.position + across * c + along * s, omega * (across * s + along * c)])


def regulated_cop(now: Situation, com: Matrix, t: float, *, is_landed: bool = False) -> Vector:
    """The CoP z* that the regulator wants, wherever the soles are [m], shape (2,).

    Args:
        now: the situation.
        com: c [m] and dc [m/s], shape (2, 2).
        t: from now [s].
        is_landed: as of `goal`.
    """
    z_d, c_d, dc_d = goal(now, t, is_landed=is_landed)
    q_1, q_2 = POLES
    return z_d + (1.0 + q_1 * q_2) * (com[0] - c_d) + (q_1 + q_2) * (com[1] - dc_d) / now.omega


def _forecast(now: Situation, times: Vector) -> tuple[Matrix, Matrix]:
    """CoPs at some times [m], shape (N, 2), and the CoM at the last one [m], [m/s], shape (2, 2)."""
    cops, com, before, omega = np.empty((len(times), 2)), now.com.matrix[:2], 0.0, now.omega
    for k, t in enumerate(times.tolist()):
        cop = cops[k] = now.clipped_inside(regulated_cop(now, com, before), t)
        c, s = math.cosh(omega * (t - before)), math.sinh(omega * (t - before))
        com = np.array([cop + c * (com[0] - cop) + s / omega * com[1], omega * s * (com[0] - cop) + c * com[1]])
        before = t
    return cops, com
