"""A scenario as a Pydantic model, for its JSON schema: the core accepts the same, and says what is wrong.

The model is made from the core's own tables of parameters, limits and metrics, so that the two
cannot drift apart. What depends on the robot, or on other values, only the core checks.
"""

import ast
import inspect
from dataclasses import fields
from itertools import pairwise
from typing import Annotated, Any, Literal, cast

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ModelWrapValidatorHandler, create_model, model_validator

from walkcore import Parameters, robot_names
from walkcore.mpc.qp import SOLVERS
from walkcore.mpc.schemes import DEPRECATED, SCHEMES
from walkcore.parameters import COM_HEIGHT_LIMITS, LIMITS
from walkcore.scenario.expectations import METRICS
from walkcore.scenario.scenario import MAX_DURATION
from walkcore.state import COM, FARTHEST, FOOT, HIGHEST, MAX_PUSHES, MAX_TICK, OFFSET


class Part(BaseModel):
    """Unknown keys, NaN, infinities and numbers as text are refused."""

    model_config = ConfigDict(extra="forbid", strict=True)


def _descriptions(kind: type) -> dict[str, str]:
    """The text below each field of a dataclass."""
    (tree,) = ast.parse(inspect.getsource(kind)).body
    found: dict[str, str] = {}
    for pair in pairwise(cast(ast.ClassDef, tree).body):
        match pair:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                found[name] = text
            case _:
                pass
    return found


def _parameter(name: str) -> Any:
    """Type of a parameter with its limits."""
    choices = {"scheme": (*SCHEMES, *DEPRECATED), "solver": tuple(SOLVERS)}
    if name in choices:
        return Literal[choices[name]]
    if name not in LIMITS and name != "com_height":
        return bool
    low, high = LIMITS.get(name, COM_HEIGHT_LIMITS)
    number: Any = Annotated[FiniteFloat, Field(ge=low, le=high)]
    return number | None if name == "com_height" else number


def _parameters_body() -> type[Part]:
    described = _descriptions(Parameters)
    members: dict[str, Any] = {
        field.name: (_parameter(field.name), Field(default=field.default, description=described[field.name]))
        for field in fields(Parameters)
    }
    return create_model(
        "ParametersBody", __base__=Part, __doc__="Of the walk. The rest have their defaults.", **members
    )


def _expect_body() -> type[Part]:
    members: dict[str, Any] = {"not_fallen": (bool, Field(default=True, description="Whether the robot stays up."))}
    for metric, meaning in METRICS.items():
        for side, words in (("max", "At most"), ("min", "At least")):
            members[f"{side}_{metric}"] = (FiniteFloat, Field(default=0.0, description=f"{words}: {meaning}."))
    doc = "Bounds on metrics: a run that breaks one fails. What is not named is not asked."
    return create_model("ExpectBody", __base__=Part, __doc__=doc, **members)


def _vectors_body(name: str, vectors: dict[str, tuple[int, float]], **more: Any) -> type[Part]:
    members: dict[str, Any] = {key: (_vector(size, limit), ...) for key, (size, limit) in vectors.items()}
    return create_model(name, __base__=Part, **members, **more)


def _vector(size: int, limit: float) -> Any:
    component = Annotated[FiniteFloat, Field(ge=-limit, le=limit)]
    return Annotated[list[component], Field(min_length=size, max_length=size)]


ParametersBody = _parameters_body()
ExpectBody = _expect_body()
ComBody = _vectors_body("ComBody", COM)
OffsetBody = _vectors_body("OffsetBody", OFFSET)
FootBody = _vectors_body("FootBody", FOOT, height=(Annotated[FiniteFloat, Field(ge=0.0, le=HIGHEST)], ...))
Configuration = list[Annotated[FiniteFloat, Field(ge=-FARTHEST, le=FARTHEST)]]


class ScenarioReference(Part):
    """Velocity asked of the CoM, in the robot's heading frame. What is missing is zero; the robot limits it."""

    vx: FiniteFloat = Field(default=0.0, description="Forward [m/s].")
    vy: FiniteFloat = Field(default=0.0, description="To the left [m/s].")
    yaw_rate: FiniteFloat = Field(default=0.0, description="Counter-clockwise [rad/s].")


class ScenarioPush(Part):
    """An impulse on the CoM; the robot limits its strength."""

    impulse: list[FiniteFloat] = Field(min_length=2, max_length=2, description="[N s]")
    duration: FiniteFloat = Field(default=0.0, ge=0.0, le=10.0, description="[s]; zero gives it all in one tick.")
    frame: Literal["robot", "world"] = Field(default="robot", description="Of the impulse.")


class EventBody(Part):
    """What changes at one time."""

    t: FiniteFloat = Field(ge=0.0, le=MAX_DURATION, description="From the beginning, up to the scenario's end [s].")
    reference: ScenarioReference = Field(default_factory=ScenarioReference, description="Holds until the next one.")
    over: FiniteFloat = Field(
        default=0.0, ge=0.0, le=MAX_DURATION, description="How long the reference takes to get there: a ramp [s]."
    )
    push: ScenarioPush = Field(default=cast(ScenarioPush, None), description="Begins at that time.")
    parameters: ParametersBody = Field(  # pyright: ignore[reportInvalidTypeForm]  # a model made above
        default_factory=ParametersBody, description="Those that change, from then on."
    )


class GaitBody(Part):
    """Where the robot is in its steps."""

    first_support: Literal["left", "right"]
    start: int | None = Field(ge=0, le=MAX_TICK, description="Sample at which the first step began; null to stand.")
    nb_steps: int | None = Field(ge=1, le=MAX_TICK, description="Steps until the feet are side by side; null: walk on.")
    step_duration: FiniteFloat = Field(
        default=cast(float, None), gt=0.0, description="Of the step under way [s]; if left out, that of the parameters."
    )


class PushLeft(Part):
    """What is left of a push under way."""

    impulse_per_tick: list[FiniteFloat] = Field(min_length=2, max_length=2, description="World frame [N s].")
    ticks_left: int = Field(ge=1, le=MAX_TICK)


class StateBody(Part):
    """All that a walk remembers between two ticks, as a saved session begins: not meant to be written by hand."""

    tick: int = Field(ge=0, le=MAX_TICK)
    gait: GaitBody
    left_foot: FootBody  # pyright: ignore[reportInvalidTypeForm]  # models made above, here and below
    right_foot: FootBody  # pyright: ignore[reportInvalidTypeForm]
    com: ComBody  # pyright: ignore[reportInvalidTypeForm]
    pushes: list[PushLeft] = Field(max_length=MAX_PUSHES)
    why_fallen: str
    com_offset: OffsetBody  # pyright: ignore[reportInvalidTypeForm]
    q: Configuration | None = Field(description="Pinocchio's order; null for a robot without a body.")
    q_before: Configuration | None


class ScenarioBody(Part):
    """A scripted walk: a robot, its parameters, and what is asked of it."""

    name: str = Field(default="unnamed")
    description: str = Field(default="")
    robot: Literal[tuple(robot_names())] = Field(default="talos")  # pyright: ignore[reportInvalidTypeForm]
    duration: FiniteFloat = Field(gt=0.0, le=MAX_DURATION, description="[s]")
    parameters: ParametersBody | None = Field(  # pyright: ignore[reportInvalidTypeForm]
        default=None, description="What is missing has its default."
    )
    initial_state: StateBody | None = Field(default=None, description="Missing: at rest at the origin.")
    events: list[EventBody] | None = Field(default=None, description="In any order.")
    expect: ExpectBody | None = Field(  # pyright: ignore[reportInvalidTypeForm]
        default=None, description="What makes the scenario a test."
    )

    _source: dict[str, Any]

    @model_validator(mode="wrap")
    @classmethod
    def _keep_source(cls, data: Any, handler: ModelWrapValidatorHandler["ScenarioBody"]) -> "ScenarioBody":
        body = handler(data)
        body._source = data if isinstance(data, dict) else body.model_dump(exclude_unset=True)
        return body

    @property
    def source(self) -> dict[str, Any]:
        """What was sent, number for number: `walk.scenario_from_mapping` takes it, and run.json repeats it."""
        return self._source


def scenario_schema() -> dict[str, Any]:
    """The JSON schema of a scenario file."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | ScenarioBody.model_json_schema()
