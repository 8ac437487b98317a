"""Recovery from pushes: was a push survived, in what time, and in how many steps.

A walk repeats itself every two steps in the places of the CoM and of the DCM, as seen from the foot that has just
landed. It has recovered from a push at the touchdown at which both are back where they were before the push, or where
they were two steps before, if another velocity is commanded meanwhile; every tick since the touchdown before must have
been solved. A robot that stands has recovered once it rests: its CoM, its CoP and its DCM lie together.

`PushRecoveryMonitor` judges tick by tick, of a live robot as of a recorded one.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from walkcore.analysis.columns import (
    Walk,
    heading,
    nb_rows_up,
    nb_ticks_of_step,
    pendulum,
    points,
    push_rows,
    reference_changes,
    timing_changes,
)
from walkcore.analysis.margins import dcm
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Footstep, Side
from walkcore.snapshot import Snapshot
from walkcore.values import Matrix, Vector, rotation

ROUNDING = 1e-6  # [s] between equal durations
RECOVERY_TOLERANCE = 0.02  # [m] between a point and its place in the undisturbed walk


@dataclass(frozen=True, slots=True, eq=False)
class BalanceState:
    """The balance of the robot at one tick, in the world frame."""

    t: float
    """Time [s]."""
    push: Vector
    """Impulse given at this tick [N s], shape (2,)."""
    com: Vector
    """[m], shape (2,)."""
    dcm: Vector
    """Divergent component of motion before this tick's push [m], shape (2,)."""
    cop: Vector
    """[m], shape (2,)."""
    support: Footstep
    phase: Phase
    status: Status
    step_duration: float = math.nan
    """Duration of the step under way, or the first one to come [s]; NaN where it is not known."""
    next_step_duration: float = math.nan
    """Duration of those after it [s]."""


def balance_state(snapshot: Snapshot, mass: float) -> BalanceState:
    """The balance of a snapshot.

    Args:
        snapshot: of a robot.
        mass: of that robot [kg].
    """
    if snapshot.plant is None:
        com, velocity, cop = snapshot.com.position, snapshot.com.velocity - snapshot.push / mass, snapshot.cop
    else:  # the model hears of a push by the body alone, and that begins to move during this tick
        measured, contact = snapshot.plant.measured, snapshot.plant.contact
        com, velocity = measured.com[:2], measured.com_velocity[:2]
        cop = snapshot.cop if contact.cop is None else contact.cop
    return BalanceState(
        t=snapshot.t,
        push=snapshot.push,
        com=com,
        dcm=com + velocity / snapshot.pendulum.omega,
        cop=cop,
        support=snapshot.support,
        phase=snapshot.phase,
        status=snapshot.status,
        step_duration=snapshot.step_duration,
        next_step_duration=snapshot.next_step_duration,
    )


@dataclass(frozen=True, slots=True)
class PushOutcome:
    """A push and its outcome, as far as it is known."""

    t: float
    """Time at which the push began [s]."""
    impulse: tuple[float, float]
    """Sum of the impulses so far, world frame [N s]."""
    survived: bool | None
    """None while nobody knows yet."""
    steps: int
    """Touchdowns since the push began, until the robot had recovered."""
    time: float | None
    """Time from the beginning of the push until the robot had recovered [s]; None as long as it has not."""
    shortened: tuple[float, ...] = ()
    """Durations of those of the steps that took less than the usual time [s]."""


class PushRecoveryMonitor:
    """Judges the latest push, tick by tick in their order."""

    def __init__(self) -> None:
        """Begin before any push."""
        self.last: PushOutcome | None = None
        self._landed: dict[Side, Matrix] = {}  # CoM and DCM in the foot's frame at its last touchdown
        self._landed_before_push: dict[Side, Matrix] = {}
        self._is_relaxed = False
        self._usual_duration = math.nan  # [s] of the steps before the push
        self._before: BalanceState | None = None

    def update(self, now: BalanceState) -> None:
        """Take in the next tick."""
        before, self._before = self._before, now
        is_pushed, was_pushed = (state is not None and bool(np.any(state.push)) for state in (now, before))
        is_relaxed = self._is_relaxed or now.status is Status.RELAXED
        stands, has_landed = now.phase is Phase.STANDING, before is not None and _has_landed(before, now)
        if now.status is Status.FALLEN:
            self._conclude(survived=False)
        elif has_landed:
            is_back = self._land(now, math.nan if before is None else before.step_duration)
            if is_back and not is_relaxed and not (is_pushed and was_pushed):
                self._conclude(survived=True)
        elif stands:
            self._landed.clear()
            if not is_pushed and not is_relaxed and _rests(now):
                self._conclude(survived=True)
        if is_pushed:
            self._begin(now, before, goes_on=was_pushed)
        self._is_relaxed = now.status is Status.RELAXED or (is_relaxed and not has_landed and not stands)

    def _begin(self, now: BalanceState, before: BalanceState | None, goes_on: bool) -> None:
        x, y = map(float, now.push)
        if goes_on and self.last is not None:
            x, y = x + self.last.impulse[0], y + self.last.impulse[1]
            self.last = replace(self.last, impulse=(x, y))
        else:
            if self.last is None or self.last.survived is not None:
                self._landed_before_push = dict(self._landed)
                self._usual_duration = math.nan if before is None else before.next_step_duration
            self.last = PushOutcome(now.t, (x, y), None, 0, None)

    def _land(self, now: BalanceState, duration: float) -> bool:
        """Note a touchdown, of a step of some duration [s]; whether the walk is back where it was."""
        foot = now.support
        places = (np.array([now.com, now.dcm]) - foot.position) @ rotation(foot.yaw)
        usual = [landed[foot.side] for landed in (self._landed_before_push, self._landed) if foot.side in landed]
        self._landed[foot.side] = places
        if self.last is not None and self.last.survived is None:
            is_shortened = duration < self._usual_duration - ROUNDING
            shortened = (*self.last.shortened, round(duration, 9)) if is_shortened else self.last.shortened
            self.last = replace(self.last, steps=self.last.steps + 1, shortened=shortened)
        return any(bool(np.all(np.hypot(*(places - there).T) < RECOVERY_TOLERANCE)) for there in usual)

    def _conclude(self, survived: bool) -> None:
        if self.last is not None and self.last.survived is None and self._before is not None:
            time = self._before.t - self.last.t if survived else None
            self.last = replace(self.last, survived=survived, time=time)


def _has_landed(before: BalanceState, now: BalanceState) -> bool:
    return now.support.side is not before.support.side and before.phase is Phase.SINGLE_SUPPORT


def _rests(now: BalanceState) -> bool:
    return all(math.dist(now.dcm, place) < RECOVERY_TOLERANCE for place in (now.com, now.cop))


@dataclass(frozen=True, slots=True)
class PushRecovery:
    """The recovery from one push of a recorded walk."""

    t: float
    """Time at which the push began [s]."""
    impulse: tuple[float, float]
    """Sum of its impulses, world frame [N s]."""
    time: float | None
    """Time until the walk repeats itself [s]; None if another push came before, or the walk ended or fell."""
    steps: int | None
    """Touchdowns until then."""
    shortened: tuple[float, ...]
    """Durations of those of the steps that took less than the usual time [s]."""
    com_deviation: float | None
    """Largest deviation of the CoM from the gait cycle before the push, repeated, until the next disturbance [m].

    None where that cycle was not steady itself: within a cycle and a step of a change or another push.
    """


def push_recoveries(walk: Walk) -> list[PushRecovery]:
    """The recoveries from all pushes of a walk, in the order of time."""
    last = nb_rows_up(walk)
    pushes = [push for push in push_rows(walk) if push[0] < last]
    changed = np.concatenate([reference_changes(walk), timing_changes(walk)])
    changes = sorted({0, *changed.tolist(), *(row for push in pushes for row in push)})
    return [
        PushRecovery(
            t=push.t,
            impulse=push.impulse,
            time=push.time,
            steps=push.steps if push.survived else None,
            shortened=push.shortened,
            com_deviation=_deviation(
                walk,
                first,
                undisturbed_since=max(row for row in changes if row < first or row == 0),
                until=min((row for row in changes if end < row < last), default=last),
            ),
        )
        for (first, end), push in zip(pushes, _outcomes(walk) if pushes else (), strict=True)
    ]


def _outcomes(walk: Walk) -> list[PushOutcome]:
    """The outcome of each push."""
    monitor = PushRecoveryMonitor()
    outcomes: dict[float, PushOutcome] = {}
    for state in _balance_states(walk):
        monitor.update(state)
        if monitor.last is not None:
            outcomes[monitor.last.t] = monitor.last
    return list(outcomes.values())


def _balance_states(walk: Walk) -> Iterator[BalanceState]:
    """The balance at each tick before a fall."""
    push, com, cop, support = (points(walk, name) for name in ("push", "com", "cop", "support"))
    before_push = dcm(walk) - push / (walk.parameters["mass"] * pendulum(walk).omega)
    if "measured_com_x" in walk.columns:  # see `balance_state`
        com, ground_cop = points(walk, "measured_com"), points(walk, "ground_cop")
        velocity = np.column_stack([walk["measured_com_vx"], walk["measured_com_vy"]])
        before_push = com + velocity / pendulum(walk).omega
        cop = np.where(np.isnan(ground_cop), cop, ground_cop)
    unknown = np.full(len(walk["t"]), math.nan)  # in recordings that are older than step timing
    durations = [walk[name] if name in walk.columns else unknown for name in ("step_duration", "next_step_duration")]
    for k in range(nb_rows_up(walk)):
        yield BalanceState(
            t=float(walk["t"][k]),
            push=push[k],
            com=com[k],
            dcm=before_push[k],
            cop=cop[k],
            support=Footstep(Side(int(walk["support_side"][k])), support[k], float(walk["support_yaw"][k])),
            phase=Phase(int(walk["phase"][k])),
            status=Status(int(walk["status"][k])),
            step_duration=float(durations[0][k]),
            next_step_duration=float(durations[1][k]),
        )


def _deviation(walk: Walk, push: int, undisturbed_since: int, until: int) -> float | None:
    step = nb_ticks_of_step(walk, push)
    if push - undisturbed_since < 3 * step:
        return None
    com = points(walk, "com")
    expected = _repeated(com, heading(walk), push, 2 * step, until)
    return float(np.max(np.hypot(*(com[push:until] - expected).T)))


def _repeated(com: Matrix, yaw: Vector, push: int, cycle: int, until: int) -> Matrix:
    """The CoM from row `push` to `until` if the gait cycle before went on, turned as that cycle turns."""
    R = rotation(float(yaw[push] - yaw[push - cycle]))
    blocks = [com[push - cycle : push]]
    while sum(map(len, blocks)) < cycle + until - push:
        blocks.append(com[push] + (blocks[-1] - com[push - cycle]) @ R.T)
    return np.vstack(blocks[1:])[: until - push]
