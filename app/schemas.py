"""What crosses the edge: bodies of requests, checked, and the live snapshot as JSON."""

import math
from collections.abc import Iterable
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from app.outlines import foothold_regions, support_polygon
from app.runner import LiveState
from walkcore import Push, Reference, Robot, Snapshot
from walkcore.recording import row


class Body(BaseModel):
    """Of a request: unknown keys, NaN, infinities and numbers as text are refused."""

    model_config = ConfigDict(extra="forbid", strict=True)


class ReferenceBody(Body):
    """Velocity asked of the CoM, in the robot's heading frame. What is missing is zero."""

    vx: FiniteFloat = Field(default=0.0, description="Forward [m/s].")
    vy: FiniteFloat = Field(default=0.0, description="To the left [m/s].")
    yaw_rate: FiniteFloat = Field(default=0.0, description="Counter-clockwise [rad/s].")

    def to_reference(self) -> Reference:
        """As the core knows it."""
        return Reference(self.vx, self.vy, self.yaw_rate)


class PushBody(Body):
    """An impulse on the CoM."""

    impulse: list[FiniteFloat] = Field(min_length=2, max_length=2, description="[N s]")
    duration: FiniteFloat = Field(default=0.0, ge=0.0, description="[s]; zero gives it all in one tick.")
    frame: Literal["robot", "world"] = Field(default="robot", description="Of the impulse.")

    def to_push(self) -> Push:
        """As the core knows it."""
        return Push(self.impulse, self.duration, self.frame)  # type: ignore[arg-type]  # a list becomes an array


class StepBody(Body):
    """Single ticks of a paused robot."""

    ticks: int = Field(default=1, ge=1, le=1000)


class TeleopMessage(Body):
    """What a joystick sends: a reference, a push, or both."""

    reference: ReferenceBody | None = None
    push: PushBody | None = None
    driver: Literal["joystick", "keyboard", "gamepad", "button"] = Field(default="joystick", description="In the hand.")
    grip: int | None = Field(
        default=None,
        ge=0,
        description="Grows each time the hand takes hold anew. A reference from an older grip than another hand's "
        "is ignored while that one drives; without a number each message takes hold.",
    )


class FieldError(BaseModel):
    """One value that was refused."""

    field: str
    value: Any
    limit: str


class ErrorBody(BaseModel):
    """What every refused request answers."""

    detail: str
    """For a person."""
    errors: list[FieldError] = []
    """For a program: each value beyond its limit."""


class Limits(BaseModel):
    """What may be asked of a robot."""

    vx: tuple[float, float] = Field(description="[m/s]")
    vy: tuple[float, float] = Field(description="[m/s]")
    yaw_rate: tuple[float, float] = Field(description="[rad/s]")
    push: float = Field(description="Strength of the strongest impulse [N s].")


class RobotBody(BaseModel):
    """A robot that ships."""

    name: str
    mass: float = Field(description="[kg]")
    com_height: float = Field(description="[m]")
    has_body: bool = Field(description="False for a point mass with feet.")
    limits: Limits


class Health(BaseModel):
    """Whether the walk keeps up with real time, and what it costs."""

    status: Literal["ok", "degraded"]
    reason: str = Field(description="Why it is degraded.")
    version: str
    robot: str
    tick_rate: float = Field(description="Ticks per simulated second [Hz].")
    real_time_factor: float = Field(description="Simulated over real time of the last seconds.")
    tick_ms: float = Field(description="Smoothed mean of a tick's computation [ms].")
    tick_ms_max: float = Field(description="Largest of the last second [ms].")
    misses: int = Field(description="Ticks that started more than one period late.")
    memory_mb: float = Field(description="Resident memory of the server [MB].")
    uptime: float = Field(description="[s]")
    clients: int = Field(description="Open streams of the live snapshot.")


def robot_body(robot: Robot) -> RobotBody:
    """A robot for a reader."""
    limits = Limits(**robot.max_reference, push=robot.max_push)  # type: ignore[arg-type]  # its keys are ours
    return RobotBody(
        name=robot.name,
        mass=robot.mass,
        com_height=robot.com_height,
        has_body=robot.body is not None,
        limits=limits,
    )


def live_json(state: LiveState, robot: Robot) -> dict[str, Any]:
    """The live snapshot: the columns of a recording, the plan, and how the walk keeps up. NaN becomes null."""
    snapshot, timing = state.snapshot, state.timing
    return {name: value if math.isfinite(value) else None for name, value in row(snapshot).items()} | {
        "q": None if snapshot.q is None else _finite(snapshot.q.tolist()),
        "plan": _plan_json(snapshot, robot),
        "timing": {
            "tick_ms": timing.tick_ms,
            "tick_ms_max": timing.tick_ms_max,
            "misses": timing.misses,
            "real_time_factor": timing.real_time_factor,
        },
        "running": state.running,
        "driver": state.driver,
        "driver_client": state.driver_client,
        "reason": snapshot.reason,
        "fault": state.fault,
    }


def _plan_json(snapshot: Snapshot, robot: Robot) -> dict[str, Any]:
    """Empty once the robot has fallen, but for the ground it lies on."""
    plan = snapshot.plan
    footholds = () if plan is None else plan.footholds
    return {
        "times": [] if plan is None else plan.times.tolist(),
        "com": [] if plan is None else plan.com.tolist(),
        "cop": [] if plan is None else plan.cop.tolist(),
        "footholds": [
            {
                "x": float(foot.position[0]),
                "y": float(foot.position[1]),
                "yaw": foot.yaw,
                "side": foot.side.value,
                "region": region.tolist(),
            }
            for foot, region in zip(footholds, foothold_regions(robot, snapshot), strict=True)
        ],
        "support_polygon": support_polygon(robot, snapshot).tolist(),
    }


def _finite(values: Iterable[float]) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values]
