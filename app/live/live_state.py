"""Values that go between the server and its control process: reference in, live state out."""

import math
from dataclasses import dataclass

from app.live.fork import Comparison
from app.live.tick_scheduler import TickTiming
from walkcore import Reference, Snapshot
from walkcore.analysis.push_recovery import PushOutcome
from walkcore.analysis.push_rose import PushRose
from walkcore.mpc.plan import Status
from walkcore.plant.world import PERFECT, World
from walkcore.state import SimulationState


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceCommand:
    """A reference, its source, and until when it holds."""

    reference: Reference
    driver: str
    """Kind of source: "none", "joystick", "keyboard", "gamepad", "button", "sliders", "rest", "phone" and
    "booth" of a booth's visitors and of its walk without them, or "past" while a
    forked walk follows the commands that came then."""
    expires_at: float = math.inf
    """Time after which it becomes zero [s], on `time.perf_counter`, which all processes of the machine share."""
    client: str = ""
    """Name of the browser that gave it; empty where no browser did."""


NO_REFERENCE = ReferenceCommand(Reference(), "none")
"""The command that holds while nobody drives."""


@dataclass(frozen=True, slots=True)
class RandomPushes:
    """A mode in which pushes come by themselves."""

    strength: float
    """Impulse of the strongest push [N s]; the weakest has half of it."""
    interval: float
    """Mean time from one push to the next [s]."""
    seed: int
    """Seed of the random numbers: the same seed gives the same pushes."""


@dataclass(frozen=True, slots=True)
class SolveCounts:
    """Numbers of ticks without an ordinary solution, since the control process started."""

    relaxed: int = 0
    """Ticks on which the paper's QP had no solution that leads on, and the relaxed QP was solved."""
    failed: int = 0
    """Falls: ticks on which nothing could keep the robot up, one for each fall."""

    def with_tick(self, before: Snapshot, now: Snapshot) -> "SolveCounts":
        """The counts with one more tick in them.

        Args:
            before: snapshot of the tick before.
            now: its own.
        """
        has_fallen = now.status is Status.FALLEN and before.status is not Status.FALLEN
        return SolveCounts(self.relaxed + (now.status is Status.RELAXED), self.failed + has_fallen)


@dataclass(frozen=True, slots=True, eq=False)
class LiveState:
    """The robot after its latest tick."""

    snapshot: Snapshot
    timing: TickTiming
    running: bool
    """Whether time passes; False while paused."""
    driver: str
    """Kind of source of the reference, as in `ReferenceCommand`."""
    driver_client: str = ""
    """Name of the browser that drives; empty where none does."""
    fault: str = ""
    """Unexpected error that paused the robot; empty where there was none."""
    speed: float = 1.0
    """Requested ratio of simulated to real time."""
    real_t: float = 0.0
    """Time on the wall during which the robot was running, since its reset [s]."""
    counts: SolveCounts = SolveCounts()
    last_push: PushOutcome | None = None
    """The latest push and how it ended; None before the first one."""
    random_pushes: RandomPushes | None = None
    """Settings of the random pushes; None while they are off."""
    next_state: SimulationState | None = None
    """State before the coming tick, with which another control process can go on."""
    robot: str = ""
    """Name of the robot."""
    plant: str = "ideal"
    """Plant that the joints move: a name of `walkcore.parameters.PLANTS`."""
    plant_reason: str = ""
    """Why it is that plant, as a sentence."""
    world: World = PERFECT
    """World that a plant with contact physics stands in."""
    twin_difference: str = ""
    """Difference between the robot and its ideal twin, as a sentence; empty where there is no twin."""
    walk: int = 0
    """Number of the walk: another one after each reset and each fork."""
    comparison: Comparison | None = None
    """The walk since a fork beside the walk that was; None without a fork since the last reset."""
    push_rose: PushRose | None = None
    """How hard a push from each side it would survive, as of a little while ago; None while nobody looks at that."""
    was: Snapshot | None = None
    """The walk that was, at this tick, without its plan's trajectories; None without a fork, or once it is over."""
