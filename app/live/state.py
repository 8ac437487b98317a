"""What is known of the live robot after its latest tick."""

from dataclasses import dataclass

from app.live.pace import Timing
from walkcore import Snapshot
from walkcore.analysis.push_recovery import PushOutcome


@dataclass(frozen=True, slots=True)
class RandomPushes:
    """A mode in which pushes come by themselves."""

    strength: float
    """Of the strongest [N s]; the weakest has half of it."""
    interval: float
    """Mean time from one to the next [s]."""
    seed: int
    """The same seed gives the same pushes."""


@dataclass(frozen=True, slots=True)
class Counts:
    """Of ticks since the control process started."""

    relaxed: int = 0
    """On which the paper's QP had no solution that leads on, and one without its margins was taken."""
    failed: int = 0
    """On which nothing could keep the robot from falling: one for each fall."""


@dataclass(frozen=True, slots=True, eq=False)
class LiveState:
    """What is known of the robot after its latest tick."""

    snapshot: Snapshot
    timing: Timing
    running: bool
    """Whether time passes; False while paused."""
    driver: str
    """Who gives the reference: "none", "joystick", "keyboard", "gamepad", "button", "sliders" or "rest"."""
    driver_client: str = ""
    """Which of several browsers that is, where one of them drives."""
    fault: str = ""
    """The unexpected error that paused the robot, where one did."""
    speed: float = 1.0
    """Simulated over real time that is asked for."""
    real_t: float = 0.0
    """Time that passed on the wall while the robot was running, since its reset [s]."""
    counts: Counts = Counts()
    last_push: PushOutcome | None = None
    """What became of it."""
    random_pushes: RandomPushes | None = None
    """None while there are none."""
