"""Bodies of requests and responses around the live robot."""

from typing import Any, Literal, Self

from pydantic import AliasChoices, BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from app.live.fork import Fork
from app.live.runner import INTERVALS, SPEEDS
from app.live.timeline import MarkKind
from walkcore import Push, Reference, Robot
from walkcore.values import MAX_TICK


class Body(BaseModel):
    """Body of a request: unknown keys, NaN, infinities and numbers as text are refused."""

    model_config = ConfigDict(extra="forbid", strict=True)


class ReferenceBody(Body):
    """Requested velocity of the CoM, in the robot's heading frame; a missing component is zero."""

    vx: FiniteFloat = Field(default=0.0, description="Forward [m/s].")
    vy: FiniteFloat = Field(default=0.0, description="To the left [m/s].")
    yaw_rate: FiniteFloat = Field(default=0.0, description="Counter-clockwise [rad/s].")

    def to_reference(self) -> Reference:
        """The reference as a value of the core."""
        return Reference(self.vx, self.vy, self.yaw_rate)


class PushBody(Body):
    """An impulse on the robot: with contact physics where it is said, of the model always on the CoM."""

    impulse: list[FiniteFloat] = Field(min_length=2, max_length=2, description="[N s]")
    duration: FiniteFloat = Field(default=0.0, ge=0.0, description="[s]; zero gives it all in one tick.")
    frame: Literal["robot", "world"] = Field(default="robot", description="Frame of the impulse.")
    link: str = Field(default="", max_length=100, description="Joint that moves the pushed link; empty for the torso.")
    point: list[FiniteFloat] | None = Field(
        default=None,
        min_length=3,
        max_length=3,
        description="Place on that link, in the frame of its joint [m]; at the link's own CoM if missing.",
    )

    def to_push(self) -> Push:
        """The push as a value of the core."""
        return Push(self.impulse, self.duration, self.frame, self.link, self.point)  # type: ignore[arg-type]  # lists


class StepBody(Body):
    """Single ticks of a paused robot, or up to a sample of the gait's grid; one tick if neither is given."""

    ticks: int | None = Field(default=None, ge=1, le=1000)
    samples: int | None = Field(default=None, ge=1, le=50, description="1 goes to the next sample, and so on.")

    @model_validator(mode="after")
    def _has_one(self) -> Self:
        if self.ticks is not None and self.samples is not None:
            raise ValueError("give ticks or samples, not both")
        return self


class SpeedBody(Body):
    """The speed of simulated time."""

    factor: FiniteFloat = Field(ge=SPEEDS[0], le=SPEEDS[1], description="Simulated over real time.")


class RandomPushesBody(Body):
    """Pushes that come by themselves, from all sides."""

    strength: FiniteFloat = Field(ge=0.0, description="Impulse of the strongest push [N s]; zero switches them off.")
    interval: FiniteFloat = Field(
        default=5.0, ge=INTERVALS[0], le=INTERVALS[1], description="Mean time from one to the next [s]."
    )
    seed: int | None = Field(default=None, ge=0, lt=2**32, description="The same seed gives the same pushes.")


class SaveBody(Body):
    """The part of the live walk to keep."""

    name: str = Field(default="", max_length=200, description="Name of the run; the time of day if it is empty.")
    before_reset: bool = Field(
        default=False,
        description="Keep the walk before the last reset, or of the robot before, instead of the present one.",
    )


class ForkBody(Body):
    """The tick from which the walk goes on anew, and what is to be different from then on."""

    tick: int = Field(ge=0, le=MAX_TICK, description="One that `GET /api/v1/live/timeline` lists, or that of the run.")
    run: str = Field(
        default="",
        max_length=64,
        description="Id of a recorded run of this robot to go on from; empty for the present walk. It is walked again "
        "up to the tick, which takes a while, and refused where that does not lead to the same numbers.",
    )
    parameters: dict[str, Any] = Field(
        default={}, max_length=100, description="Changed from those in force at that tick; their later changes are not."
    )
    present_parameters: bool = Field(
        default=False, description="Begin with the parameters in force now, not with those at that tick."
    )
    reference: ReferenceBody | None = Field(default=None, description="In place of the references that came then.")
    push: PushBody | None = Field(default=None, description="At that tick, in place of the one that came then.")
    follow: bool = Field(
        default=True, description="Let the commands come again that came then, until somebody drives; else it stops."
    )

    def to_fork(self) -> Fork:
        """The fork as a value of the control."""
        return Fork(
            self.tick,
            self.parameters,
            self.present_parameters,
            None if self.reference is None else self.reference.to_reference(),
            None if self.push is None else self.push.to_push(),
            self.follow,
        )


class LookMessage(Body):
    """Message of a browser that looks at an earlier tick."""

    tick: int | None = Field(ge=0, le=MAX_TICK, description="None for the present.")
    run: str = Field(default="", max_length=64, description="Id of a recorded run; empty for the live walk.")


class MarkBody(BaseModel):
    """Something that happened at a tick."""

    tick: int
    kind: MarkKind
    text: str


class TimelineBody(BaseModel):
    """The ticks of the present walk that can be looked at and gone on from: the last two minutes."""

    walk: int = Field(description="Number of the walk: another one after each reset and each fork.")
    first_tick: int
    last_tick: int
    control_period: float = Field(description="From one tick to the next [s].")
    marks: list[MarkBody] = Field(description="Pushes, falls, changed parameters, and the last fork.")
    no_fork: str = Field(default="", description="Why no tick can be gone on from; empty where one may be.")


class TeleopMessage(Body):
    """Message of a control in a browser: a reference, a push, or both."""

    reference: ReferenceBody | None = None
    push: PushBody | None = None
    driver: Literal["joystick", "keyboard", "gamepad", "button"] = Field(default="joystick", description="The control.")
    engagement: int | None = Field(
        default=None,
        ge=0,
        validation_alias=AliasChoices("engagement", "grip"),
        description="Number of the current hold of the control, which grows each time it is taken hold of. References "
        "from an older hold than another client's are ignored while that client drives; without a number each message "
        "takes hold. `grip` is its deprecated name, still accepted.",
    )


class FieldError(BaseModel):
    """One value that was refused."""

    field: str
    value: Any
    limit: str


class ErrorBody(BaseModel):
    """Response to every refused request."""

    detail: str
    """The reason, for a person."""
    errors: list[FieldError] = []
    """Each value beyond its limit, for a program."""


class RobotLimits(BaseModel):
    """Limits of references and pushes."""

    vx: tuple[float, float] = Field(description="[m/s]")
    vy: tuple[float, float] = Field(description="[m/s]")
    yaw_rate: tuple[float, float] = Field(description="[rad/s]")
    push: float = Field(description="Strongest impulse [N s].")


class RobotBody(BaseModel):
    """A robot that ships, or walks here."""

    name: str
    title: str = Field(description="Name as it is written in a sentence.")
    mass: float = Field(description="[kg]")
    com_height: float = Field(description="[m]")
    has_body: bool = Field(description="False for a point mass with feet.")
    limits: RobotLimits


class LiveRobotBody(RobotBody):
    """The robot that walks here."""

    height: float = Field(description="Height of its body as it is drawn [m].")


class Health(BaseModel):
    """Whether the walk keeps up with real time, and what it costs."""

    status: Literal["ok", "degraded", "unhealthy"] = Field(
        description="Unhealthy, with status 503, while the control process does not respond."
    )
    reason: str = Field(description="Why the server is not ok.")
    version: str
    robot: str
    tick_rate: float = Field(description="Ticks per simulated second [Hz].")
    speed: float = Field(description="Requested ratio of simulated to real time.")
    real_time_factor: float = Field(description="Fraction of that speed that was reached over the last seconds.")
    tick_ms: float = Field(description="Smoothed mean of a tick's computation [ms].")
    tick_ms_max: float = Field(description="Largest computation of a tick in the last second [ms].")
    misses: int = Field(description="Ticks that started more than one period late.")
    late: dict[str, int] = Field(description="Number of ticks that started later than each number of ms.")
    control_process: int = Field(description="Id of the process in which the ticks are taken.")
    memory_mb: float = Field(description="Resident memory of the server and its control process [MB].")
    uptime: float = Field(description="Time since the server started [s].")
    clients: int = Field(description="Open streams of the live snapshot.")
    runs: str = Field(
        description="What keeps runs from being kept, or was set right in their folder; empty if nothing."
    )


class RobotChoice(Body):
    """The robot that is to walk."""

    robot: str = Field(max_length=100, description="Name of one of `GET /api/v1/robots`.")


class LeaseRequest(Body):
    """The browser that is to drive alone."""

    client: str = Field(min_length=1, max_length=64, description="Name of its controls, as `driver_client` tells it.")
    by: str = Field(default="", max_length=64, description="Name of the holder that hands over, where there is one.")


class LeaseBody(BaseModel):
    """Which browser drives alone."""

    holder: str = Field(description="Name of its controls; empty where none does.")
    expires_in: float = Field(description="Time until it loses that without a command [s].")
    clients: list[str] = Field(description="Names of the controls that are connected.")


class Session(BaseModel):
    """Rights of a client."""

    role: Literal["operator", "viewer"] = Field(description="A viewer may only look.")


def robot_body(robot: Robot) -> RobotBody:
    """A robot with its limits."""
    limits = RobotLimits(**robot.max_reference, push=robot.max_push)  # type: ignore[arg-type]  # its keys are ours
    return RobotBody(
        name=robot.name,
        title=robot.title,
        mass=robot.mass,
        com_height=robot.com_height,
        has_body=robot.body is not None,
        limits=limits,
    )
