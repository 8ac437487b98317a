"""Margins of a walk: distances of the CoP and of the DCM from the edges of the support polygon.

    xi = c + dc / omega

is where the pendulum can be brought to rest: while the DCM xi is inside, the robot need not step.
"""

import math
from collections.abc import Iterator

import numpy as np

from walkcore.analysis.columns import Walk, pendulum, points
from walkcore.mpc.gait import Phase
from walkcore.mpc.regions import HalfPlanes, half_planes
from walkcore.mpc.stance import Footstep, Side, Stance
from walkcore.values import Matrix, Vector


def dcm(walk: Walk) -> Matrix:
    """The DCM of each tick, world frame [m], shape (ticks, 2)."""
    return points(walk, "com") + np.column_stack([walk["com_vx"], walk["com_vy"]]) / pendulum(walk).omega


def support_margins(walk: Walk, places: Matrix) -> Vector:
    """Distance of a point from the edge of the support polygon at each tick [m]; negative outside, shape (ticks,).

    Args:
        walk: whose soles on the ground span the polygon.
        places: one point a tick, shape (ticks, 2).
    """
    margins = np.empty(len(places))
    for rows, ground in _grounds(walk):
        along = places[rows] @ ground.normals.T
        margins[rows] = np.minimum(ground.upper - along, along - ground.lower).min(axis=1)
    return margins


def _grounds(walk: Walk) -> Iterator[tuple[slice, HalfPlanes]]:
    """Rows between which the soles on the ground do not change, and their hull."""
    is_single = walk["phase"] == Phase.SINGLE_SUPPORT
    feet = np.stack([[walk[f"{foot}_{name}"] for name in ("x", "y", "yaw")] for foot in ("left", "right")])
    in_air = np.stack([is_single & (walk["support_side"] == side.other) for side in Side])
    feet[np.broadcast_to(in_air[:, None], feet.shape)] = math.nan
    state = feet.reshape(6, -1)
    changed = np.any((state[:, 1:] != state[:, :-1]) & ~(np.isnan(state[:, 1:]) & np.isnan(state[:, :-1])), axis=0)
    starts = np.concatenate([[0], np.flatnonzero(changed) + 1])
    sole = np.array(walk.parameters["sole"]["polygon"])
    for first, end in zip(starts, [*starts[1:], state.shape[1]], strict=True):
        standing = [side for side in Side if not in_air[side, first]]
        stance = Stance(tuple(Footstep(s, feet[s, :2, first], float(feet[s, 2, first])) for s in standing), sole)
        yield slice(int(first), int(end)), half_planes(stance.corners)
