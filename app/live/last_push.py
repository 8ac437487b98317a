"""Follows what becomes of a push: was it survived, and in how many steps.

A walk repeats itself every two steps in the place of the capture point

    xi = c + dc / omega

as seen from the foot that has just landed. A push is over at the touchdown at which xi is back
where it was before the push, or, if another velocity is asked for meanwhile, where it was two
steps before. A robot that stands is back once it stands still, be it off its middle: nothing asks it
to come back there. No margin may have been given up since the touchdown before.
"""

import math
from dataclasses import replace

import numpy as np

from app.live.state import LastPush
from walkcore import Snapshot
from walkcore.gait import Phase, Side
from walkcore.pattern_generator import Status
from walkcore.values import Vector, rotation

BACK = 0.02  # [m] of the capture point from where it was
STILL = 0.02  # [m/s]


class PushFollower:
    """Looks at every snapshot, in their order."""

    def __init__(self, gravity: float) -> None:
        """No push yet; gravity [m/s^2]."""
        self._gravity = gravity
        self.last: LastPush | None = None
        self._landed: dict[Side, Vector] = {}
        self._landed_before_push: dict[Side, Vector] = {}
        self._is_relaxed = False
        self._before: Snapshot | None = None

    def see(self, snapshot: Snapshot) -> None:
        """Take note of a tick."""
        before, self._before = self._before, snapshot
        if np.any(snapshot.push):
            self._begin(snapshot, goes_on=before is not None and bool(np.any(before.push)))
        if before is None:
            return
        has_landed = snapshot.support.side is not before.support.side and before.phase is Phase.SINGLE_SUPPORT
        if has_landed:
            self._land(snapshot)
        if snapshot.status is Status.FALLEN:
            self._conclude(survived=False)
        elif snapshot.phase is Phase.STANDING:
            self._landed.clear()
            self._judge(math.hypot(*snapshot.com.velocity) < STILL)
        self._is_relaxed = (self._is_relaxed and not has_landed) or snapshot.status is Status.RELAXED

    def _begin(self, snapshot: Snapshot, goes_on: bool) -> None:
        x, y = map(float, snapshot.push)
        if goes_on and self.last is not None:
            x, y = x + self.last.impulse[0], y + self.last.impulse[1]
            self.last = replace(self.last, impulse=(x, y), survived=None)
        else:
            if self.last is None or self.last.survived is not None:
                self._landed_before_push = dict(self._landed)
            self.last = LastPush(snapshot.t, (x, y), None, 0)

    def _land(self, snapshot: Snapshot) -> None:
        foot = snapshot.support
        place = rotation(foot.yaw).T @ (self._capture_point(snapshot) - foot.position)
        usual = (self._landed_before_push.get(foot.side), self._landed.get(foot.side))
        self._landed[foot.side] = place
        if self.last is not None and self.last.survived is None:
            self.last = replace(self.last, steps=self.last.steps + 1)
        self._judge(any(there is not None and math.dist(place, there) < BACK for there in usual))

    def _judge(self, is_back: bool) -> None:
        if is_back and not self._is_relaxed:
            self._conclude(survived=True)

    def _conclude(self, survived: bool) -> None:
        if self.last is not None and self.last.survived is None:
            self.last = replace(self.last, survived=survived)

    def _capture_point(self, snapshot: Snapshot) -> Vector:
        return snapshot.com.position + snapshot.com.velocity * math.sqrt(snapshot.com_height / self._gravity)
