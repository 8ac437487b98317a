"""Yaws of the coming footsteps, decided before the QP so that it stays linear (section 4).

The paper only says that they are fixed beforehand; the rule is ours. The heading turns by yaw_rate * step_duration a
step. The foot on the inside of the turn cannot toe in by that much without the soles coming close, so it turns by what
it may, and the outer foot, which can toe out, makes up for it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from walkcore.mpc.stance import Footstep, Side

MAX_TOE_IN, MAX_TOE_OUT = 0.09, 0.45  # [rad], of a foothold against the one before it


@dataclass(frozen=True, slots=True)
class Turn:
    """A turn that is commanded, and how far the foot in the air can follow it."""

    yaw_rate: float
    """Commanded turn of the heading [rad/s]."""
    step_duration: float
    """[s]."""
    swing_reach: float
    """Angle by which the foot in the air can still turn before it lands [rad]."""


def foothold_yaws(support: Footstep, swing: Footstep, turn: Turn, nb_footholds: int) -> Sequence[float]:
    """Yaw of each foothold to come, in the world frame [rad].

    Args:
        support: foot on the ground.
        swing: foot in the air, with its yaw now.
        turn: that is commanded.
        nb_footholds: number of yaws.
    """
    yaws: list[float] = []
    yaw, side = support.yaw, swing.side
    for k in range(nb_footholds):
        yaw += turn_of_step(side, turn.yaw_rate * turn.step_duration)
        if k == 0:
            yaw = min(max(yaw, swing.yaw - turn.swing_reach), swing.yaw + turn.swing_reach)
        yaws.append(yaw)
        side = side.other
    return yaws


def turn_of_step(side: Side, heading_change: float) -> float:
    """Yaw of a foothold against the one before it [rad].

    Args:
        side: of the foot that lands.
        heading_change: commanded turn of the heading in a step [rad].
    """
    outwards = heading_change * side.sign  # positive when this foot has to toe out
    toe_in = min(abs(outwards), MAX_TOE_IN)
    if outwards < 0.0:
        return -toe_in * side.sign
    return min(2.0 * outwards - toe_in, MAX_TOE_OUT) * side.sign
