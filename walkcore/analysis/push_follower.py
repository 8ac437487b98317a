"""Follows what becomes of a push, tick by tick: was it survived, in what time, and in how many steps.

A walk repeats itself every two steps in the places of the CoM and of the capture point

    xi = c + dc / omega

as seen from the foot that has just landed. It has recovered from a push at the touchdown at which
both are back where they were before the push, or where they were two steps before, if another
velocity is asked for meanwhile; no margin may have been given up since the touchdown before. A
robot that stands has recovered once it rests: its CoM, its CoP and xi lie together.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Footstep, Side
from walkcore.snapshot import Snapshot
from walkcore.values import Matrix, Vector, rotation

BACK = 0.02  # [m] from where they should be


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """What of a tick tells how a push is taken, in the world frame."""

    t: float
    """[s]."""
    push: Vector
    """Impulse given at this tick [N s], shape (2,)."""
    com: Vector
    """[m], shape (2,)."""
    capture_point: Vector
    """Before this tick's push [m], shape (2,)."""
    cop: Vector
    """[m], shape (2,)."""
    support: Footstep
    phase: Phase
    status: Status


def moment_of(snapshot: Snapshot, mass: float) -> Moment:
    """The part of a snapshot that matters here; mass [kg]."""
    velocity = snapshot.com.velocity - snapshot.push / mass
    return Moment(
        t=snapshot.t,
        push=snapshot.push,
        com=snapshot.com.position,
        capture_point=snapshot.com.position + velocity / snapshot.pendulum.omega,
        cop=snapshot.cop,
        support=snapshot.support,
        phase=snapshot.phase,
        status=snapshot.status,
    )


@dataclass(frozen=True, slots=True)
class FollowedPush:
    """What is known of a push."""

    t: float
    """When it began [s]."""
    impulse: tuple[float, float]
    """All of it so far, world frame [N s]."""
    survived: bool | None
    """None while nobody knows yet."""
    steps: int
    """Touchdowns since it began, until the robot had recovered."""
    time: float | None
    """From its beginning until the robot had recovered [s]; None as long as it has not."""


class PushFollower:
    """Looks at every tick, in their order."""

    def __init__(self) -> None:
        """No push yet."""
        self.last: FollowedPush | None = None
        self._landed: dict[Side, Matrix] = {}  # CoM and capture point in the foot's frame
        self._landed_before_push: dict[Side, Matrix] = {}
        self._is_relaxed = False
        self._before: Moment | None = None

    def see(self, now: Moment) -> None:
        """Take note of a tick."""
        before, self._before = self._before, now
        is_pushed, was_pushed = (moment is not None and bool(np.any(moment.push)) for moment in (now, before))
        is_relaxed = self._is_relaxed or now.status is Status.RELAXED
        stands, has_landed = now.phase is Phase.STANDING, before is not None and _has_landed(before, now)
        if now.status is Status.FALLEN:
            self._conclude(survived=False)
        elif has_landed:
            is_back = self._land(now)
            if is_back and not is_relaxed and not (is_pushed and was_pushed):
                self._conclude(survived=True)
        elif stands:
            self._landed.clear()
            if not is_pushed and not is_relaxed and _rests(now):
                self._conclude(survived=True)
        if is_pushed:
            self._begin(now, goes_on=was_pushed)
        self._is_relaxed = now.status is Status.RELAXED or (is_relaxed and not has_landed and not stands)

    def _begin(self, now: Moment, goes_on: bool) -> None:
        x, y = map(float, now.push)
        if goes_on and self.last is not None:
            x, y = x + self.last.impulse[0], y + self.last.impulse[1]
            self.last = replace(self.last, impulse=(x, y))
        else:
            if self.last is None or self.last.survived is not None:
                self._landed_before_push = dict(self._landed)
            self.last = FollowedPush(now.t, (x, y), None, 0, None)

    def _land(self, now: Moment) -> bool:
        """A foot has come to the ground; whether the walk is back."""
        foot = now.support
        places = (np.array([now.com, now.capture_point]) - foot.position) @ rotation(foot.yaw)
        usual = [landed[foot.side] for landed in (self._landed_before_push, self._landed) if foot.side in landed]
        self._landed[foot.side] = places
        if self.last is not None and self.last.survived is None:
            self.last = replace(self.last, steps=self.last.steps + 1)
        return any(bool(np.all(np.hypot(*(places - there).T) < BACK)) for there in usual)

    def _conclude(self, survived: bool) -> None:
        if self.last is not None and self.last.survived is None and self._before is not None:
            time = self._before.t - self.last.t if survived else None
            self.last = replace(self.last, survived=survived, time=time)


def _has_landed(before: Moment, now: Moment) -> bool:
    return now.support.side is not before.support.side and before.phase is Phase.SINGLE_SUPPORT


def _rests(now: Moment) -> bool:
    return all(math.dist(now.capture_point, place) < BACK for place in (now.com, now.cop))
