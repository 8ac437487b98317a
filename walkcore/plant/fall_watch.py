"""Why a body fell: which of its limits gave way first, told in the terms of the push and of the step.

signs = signs.seen(now, tick)        # each tick, the limits that are reached now
reason = signs.explain(...)          # when the body has fallen
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from walkcore.mpc.stance import Footstep, Side
from walkcore.plant.plant import Measurement, SolePose
from walkcore.values import Matrix, Vector, freeze, rotation

LOWEST = 0.75  # of the CoM's height: a body below has fallen
MAX_TILT = 0.8  # [rad] of the torso from upright
TILTED = 0.06  # [rad] from which a sole stands on an edge
FORGOTTEN = 1.0  # [s] after which a limit that was reached once has been survived
NB_TOLD = 3  # limits, so that a sentence stays one
AT_ONCE = 0.05  # [s] after a push
PUSH_MATTERS = 10.0  # [s] in which a fall is told by the push

SIGNS = {
    "cop_at_edge": "the CoP had reached the edge of the soles",
    "torque_saturated": "a joint's torque had reached its limit",
    "step_too_short": "the planned step no longer sufficed",
    "not_capturable": "the DCM had left the set from which a step can catch it",
    "sole_tilted": "the sole that stood had tilted",
}
"""Limits by name, and the words for having reached each."""


@dataclass(frozen=True, slots=True)
class Sign:
    """A limit that was reached."""

    name: str
    """Key of SIGNS."""
    first: int
    """Tick."""
    last: int
    """Tick."""


@dataclass(frozen=True, slots=True)
class LastPush:
    """The push that a fall may be told by."""

    tick: int
    forward: float
    """Impulse in the robot's heading frame [N s]."""
    left: float
    """[N s]."""
    phase: str
    """Phase of the gait when it began, in words."""


@dataclass(frozen=True, slots=True, eq=False)
class NeededStep:
    """The step that would have stopped the robot, beside what its legs can reach."""

    support: Footstep
    """The foot that carried the robot."""
    place: Vector
    """Place of the step, in the frame of the support foot [m], shape (2,)."""
    region: Matrix
    """Where the foot could land, in the same frame [m], shape (V, 2)."""
    limit: float
    """Edge of the region on the side where the step lies beyond it [m]."""
    is_sideways: bool
    """Whether that is along y, and not along x."""

    @property
    def foothold(self) -> Footstep:
        """The step in the world frame."""
        support = self.support
        return Footstep(support.side.other, support.position + rotation(support.yaw) @ self.place, support.yaw)

    @property
    def needed(self) -> float:
        """The step along the axis on which it is out of reach [m]."""
        return float(self.place[int(self.is_sideways)])

    def in_words(self) -> str:
        """The step and the region."""
        way = direction_in_words(0.0, self.needed) if self.is_sideways else direction_in_words(self.needed, 0.0)
        end = "across the other leg"
        if self.needed * self.limit > 0.0:  # else the other leg stands in the way
            verb = "begins" if abs(self.needed) < abs(self.limit) else "ends"
            end = f"the region {verb} at {abs(self.limit):.2f} m"
        return f"the step needed was {abs(self.needed):.2f} m {way}, {end}"


def needed_step(support: Footstep, dcm_at_touchdown: Vector, region: Matrix, sole: Matrix) -> NeededStep | None:
    """The step that stops the robot, where it is out of reach: the sole would have to reach the DCM.

    Args:
        support: the foot that carries the robot.
        dcm_at_touchdown: DCM when the foot comes down, in the support foot's frame [m], shape (2,).
        region: where that foot may land, in the same frame [m], shape (V, 2).
        sole: outline of a sole in its own frame [m], shape (V, 2).

    Returns:
        None where the step is within the region along both axes.
    """
    half = np.max(np.abs(sole), axis=0)
    low, high = region.min(axis=0), region.max(axis=0)
    beyond = dcm_at_touchdown - np.clip(dcm_at_touchdown, low - half, high + half)
    axis = int(np.argmax(np.abs(beyond)))
    if beyond[axis] == 0.0:
        return None
    limit = float(high[axis] if beyond[axis] > 0.0 else low[axis])
    place = np.clip(dcm_at_touchdown, low, high)
    place[axis] = limit + beyond[axis]
    return NeededStep(support, freeze(place), region, limit, is_sideways=axis == 1)


@dataclass(frozen=True, slots=True)
class FallSigns:
    """The limits that were reached lately, in the order in which they were, the last push, and the step it needed."""

    signs: tuple[Sign, ...] = ()
    push: LastPush | None = None
    step: NeededStep | None = None
    """Step needed when the DCM left the capturable set; None before, or where it was within reach."""

    def pushed(self, push: LastPush, goes_on: bool) -> "FallSigns":
        """The signs after a push; those before it no longer count.

        Args:
            push: given now.
            goes_on: whether it is another piece of the last one, which is held.
        """
        if not goes_on or self.push is None:
            return FallSigns((), push)
        whole = replace(self.push, forward=self.push.forward + push.forward, left=self.push.left + push.left)
        return FallSigns(self.signs, whole, self.step)

    def seen(self, now: Sequence[str], tick: int, period: float, step: NeededStep | None = None) -> "FallSigns":
        """The signs one tick later.

        Args:
            now: names of the limits that are reached at this tick.
            tick: of it.
            period: of a tick [s].
            step: that is needed at this tick and out of reach.
        """
        if not now and not self.signs:
            return self
        recent = [sign for sign in self.signs if (tick - sign.last) * period < FORGOTTEN]
        known = {sign.name for sign in recent}
        needed = (self.step or step) if "not_capturable" in {*known, *now} else None
        kept = [Sign(sign.name, sign.first, tick) if sign.name in now else sign for sign in recent]
        return FallSigns((*kept, *(Sign(name, tick, tick) for name in now if name not in known)), self.push, needed)

    def explain(self, tick: int, period: float) -> str:
        """The reason of a fall in words.

        Args:
            tick: at which the body has fallen.
            period: of a tick [s].
        """
        push = self.push if self.push is not None and (tick - self.push.tick) * period < PUSH_MATTERS else None
        words = "the robot fell"
        if push is not None:
            strength, direction = math.hypot(push.forward, push.left), direction_in_words(push.forward, push.left)
            after = (tick - push.tick) * period
            words = f"{strength:.0f} N s {direction} {push.phase}: the robot fell {after:.1f} s later"
        if self.step is not None:
            words = f"{words}; {self.step.in_words()}"
        told = [f"{SIGNS[sign.name]} ({_when(sign, tick, push, period)})" for sign in self.signs[:NB_TOLD]]
        return f"{words}; first {', then '.join(told)}" if told else words


def _when(sign: Sign, tick: int, push: LastPush | None, period: float) -> str:
    if push is None:
        return f"{(tick - sign.first) * period:.2f} s before"
    after = (sign.first - push.tick) * period
    return "at once" if after < AT_ONCE else f"after {after:.1f} s"


def has_fallen(measured: Measurement, height: float) -> bool:
    """Whether a body lies, or can no longer be caught.

    Args:
        measured: the body.
        height: of the model's CoM [m].
    """
    return bool(measured.com[2] < LOWEST * height or measured.tilt > MAX_TILT)


def is_tilted(sole: SolePose) -> bool:
    """Whether a sole stands on an edge."""
    return sole.tilt > TILTED


def direction_in_words(forward: float, left: float) -> str:
    """The direction of a push in the robot's heading frame, in words."""
    ways = ("forward", "forward and left", "to the left", "back and left", "backward", "back and right", "to the right")
    return (*ways, "forward and right")[round(math.atan2(left, forward) / (math.pi / 4)) % 8]


def phase_in_words(is_single_support: bool, is_standing: bool, support: Side) -> str:
    """The phase of the gait, in words."""
    if is_standing:
        return "while it stood"
    foot = support.other.name.lower()
    return f"while the {foot} foot was in the air" if is_single_support else f"as the {foot} foot was about to lift"
