"""Finds pushes between two drawn frames.

A push may last one tick, and a viewer sees one tick in seven. What it does see is the
momentum that the CoM's acceleration does not explain:

    impulse = m (dc(t) - dc(s) - integral of ddc from s to t)

with the integral by the trapezoidal rule: ddc is continuous, because the jerk is bounded.
"""

import math

import numpy as np
from numpy.typing import NDArray

from walkcore import Snapshot
from walkcore.mpc.plan import Status

LONGEST_GAP = 0.1  # [s] over which the trapezoidal rule still holds
WEAKEST = 0.06  # [m/s] of sudden change of velocity that counts as a push


class PushWatch:
    """Remembers the last snapshot that was drawn."""

    def __init__(self, mass: float) -> None:
        """Watch a robot of that mass [kg]."""
        self._mass = mass
        self._before: Snapshot | None = None

    def impulse(self, snapshot: Snapshot) -> NDArray[np.float64] | None:
        """The impulse since the last call, world frame [N s], shape (2,); none where there was no push."""
        before, self._before = self._before, snapshot
        if before is None or snapshot.status is Status.FALLEN:
            return None
        gap = snapshot.t - before.t
        if not 0.0 < gap <= LONGEST_GAP:
            return None
        (_, v, a), (_, v_before, a_before) = snapshot.com.matrix.tolist(), before.com.matrix.tolist()
        change = [v[i] - v_before[i] - (a_before[i] + a[i]) / 2 * gap for i in range(2)]
        return self._mass * np.array(change) if math.hypot(*change) > WEAKEST else None
