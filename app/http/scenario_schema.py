"""JSON schema of a scenario, as documentation: only the core judges scenarios.

It is made from the core's own tables of parameters, limits and metrics, so that the two cannot drift apart. Limits that
depend on the robot, or on other values, are not in it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

from app.descriptions import descriptions
from walkcore import Parameters, robot_names
from walkcore.command import FARTHEST_POINT
from walkcore.mpc.qp import SOLVERS
from walkcore.mpc.schemes import DEPRECATED, SCHEMES
from walkcore.parameters import COM_HEIGHT_LIMITS, LIMITS, PLANTS, STEP_TIMINGS
from walkcore.plant.driver_state import MAX_DELAYED, MAX_PLANT_NUMBERS
from walkcore.plant.fall_watch import SIGNS
from walkcore.plant.world import LIMITS as WORLD_LIMITS
from walkcore.plant.world import MAX_SEED, SENSORS, World
from walkcore.pushes import MAX_PUSHES
from walkcore.robot_file import DEFAULT_ROBOT
from walkcore.scenario.expectations import METRICS
from walkcore.scenario.scenario import MAX_DURATION, MAX_SOLVES
from walkcore.state import COM, FLIGHT, FOOT, HIGHEST, KEYS, MAX_SAMPLES, OFFSET, OPTIONAL_KEYS
from walkcore.values import FARTHEST, MAX_TICK

Json = dict[str, Any]


def scenario_schema() -> Json:
    """The JSON schema of a scenario file."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | SCENARIO


def request_schema() -> Json:
    """The JSON schema of a scenario in a request, where a robot may be of the server's own folder, too."""
    robot = _text("Name of one of `GET /api/v1/robots`.", default=DEFAULT_ROBOT)
    return SCENARIO | {"properties": SCENARIO["properties"] | {"robot": robot}}


def _object(description: str, required: Sequence[str] = (), /, **properties: Json) -> Json:
    """A mapping with these keys, some of them required, and no others."""
    return {
        "type": "object",
        "description": description,
        "properties": properties,
        "required": list(required),
        "additionalProperties": False,
    }


def _number(description: str = "", low: float | None = None, high: float | None = None, **more: Any) -> Json:
    limits = {"minimum": low, "maximum": high}
    described = {"description": description} if description else {}
    return {"type": "number"} | described | {key: limit for key, limit in limits.items() if limit is not None} | more


def _whole(description: str, low: float, high: float, **more: Any) -> Json:
    return _number(description, low, high, **more) | {"type": "integer"}


def _text(description: str, **more: Any) -> Json:
    return {"type": "string", "description": description} | more


def _choice(description: str, choices: Sequence[str], **more: Any) -> Json:
    return {"enum": list(choices), "description": description} | more


def _list(items: Json, description: str = "", low: int | None = None, high: int | None = None) -> Json:
    lengths = {key: length for key, length in (("minItems", low), ("maxItems", high)) if length is not None}
    return {"type": "array", "items": items} | lengths | ({"description": description} if description else {})


def _optional(schema: Json) -> Json:
    """A value that may also be null, which is as good as missing."""
    return schema | {"type": [schema["type"], "null"]}


def _complete(description: str, /, **members: Json) -> Json:
    """A mapping with these keys, all of them required, and no others."""
    return _object(description, tuple(members), **members)


def _vectors(vectors: Mapping[str, tuple[int, float]]) -> dict[str, Json]:
    """Vectors by their names, each with its number of components and their limit."""
    return {
        name: _list(_number(low=-limit, high=limit), low=size, high=size) for name, (size, limit) in vectors.items()
    }


def _parameters() -> Json:
    described = descriptions(Parameters)
    members = {field.name: _parameter(field.name, described[field.name], field.default) for field in fields(Parameters)}
    return _object("Parameters of the walk; a missing one has its default.", **members)


def _parameter(name: str, description: str, default: Any) -> Json:
    choices = {
        "scheme": (*SCHEMES, *DEPRECATED),
        "solver": tuple(SOLVERS),
        "step_timing": STEP_TIMINGS,
        "plant": PLANTS,
    }
    if name in choices:
        return _choice(description, choices[name], default=default)
    if name == "com_height":
        return _optional(_number(description, *COM_HEIGHT_LIMITS, default=default))
    if name not in LIMITS:
        return {"type": "boolean", "description": description, "default": default}
    return (_whole if isinstance(default, int) else _number)(description, *LIMITS[name], default=default)


def _expectations() -> Json:
    bounds = {
        f"{side}_{metric}": _number(f"{words}: {meaning}.")
        for metric, meaning in METRICS.items()
        for side, words in (("max", "At most"), ("min", "At least"))
    }
    not_fallen: Json = {"type": "boolean", "description": "Whether the robot stays up."}
    return _object("Bounds on metrics: a run that breaks one fails.", not_fallen=not_fallen, **bounds)


PARAMETERS = _parameters()
REFERENCE = _object(
    "Requested velocity of the CoM, in the robot's heading frame; a missing component is zero. The robot limits it.",
    vx=_number("Forward [m/s].", default=0.0),
    vy=_number("To the left [m/s].", default=0.0),
    yaw_rate=_number("Counter-clockwise [rad/s].", default=0.0),
)
PUSH = _object(
    "An impulse on the CoM; the robot limits its strength.",
    ("impulse",),
    impulse=_list(_number(), "[N s]", 2, 2),
    duration=_number("[s]; zero gives it all in one tick.", 0.0, 10.0, default=0.0),
    frame=_choice("Frame of the impulse.", ("robot", "world"), default="robot"),
    link=_text("Joint whose link is pushed; empty for the torso. The ideal plant is pushed at its CoM.", default=""),
    point=_optional(
        _list(_number("", -FARTHEST_POINT, FARTHEST_POINT), "On that link, in its joint's frame [m].", 3, 3)
    ),
)
EVENT = _object(
    "Changes at one time.",
    ("t",),
    t=_number("Time from the beginning, up to the scenario's end [s].", 0.0, MAX_DURATION),
    reference=REFERENCE | {"description": f"{REFERENCE['description']} It holds until the next one."},
    over=_number("Time that the reference takes to get there, by a ramp [s].", 0.0, MAX_DURATION, default=0.0),
    push=PUSH,
    parameters=PARAMETERS | {"description": "Parameters that change, from then on."},
    solves_in_time=_optional(
        _whole("Solves that this one tick of a saved live walk had the time for; null for all.", 0, MAX_SOLVES)
    ),
)
RETIMING = _complete(
    "Other durations than those of the parameters, chosen by adaptive step timing; null for none.",
    offset=_whole("Ticks from the sample `start` to the beginning of the first step.", 0, MAX_TICK),
    first_step_ticks=_whole("Duration of the first step in ticks.", 2, MAX_TICK),
    samples_per_step=_whole("Samples that each step after it takes.", 2, MAX_SAMPLES),
)
FLIGHT_UNDER_WAY = _complete(
    "Height of a foot whose touchdown was moved while it was in the air; null for none.",
    start=_whole("Tick at which the touchdown was moved.", 0, MAX_TICK),
    touchdown=_whole("Tick of the new one.", 0, MAX_TICK),
    **{name: _number("At the start, in SI units.", low, high) for name, (low, high) in FLIGHT.items()},
)
WORLD = _object(
    "World that contact physics stands in; needs parameters.plant: mujoco.",
    **{
        field.name: _choice(described, SENSORS, default=field.default)
        if field.name == "sensors"
        else _whole(described, 0, MAX_SEED, default=field.default)
        if field.name == "seed"
        else _number(described, *WORLD_LIMITS[field.name], default=field.default)
        for field, described in ((field, descriptions(World)[field.name]) for field in fields(World))
    },
)
GAIT = _object(
    "Position of the robot in its steps.",
    ("first_support", "start", "nb_steps"),
    first_support=_choice("Foot that carried the first step.", ("left", "right")),
    start=_optional(_whole("Sample at which the first step began; null to stand.", 0, MAX_TICK)),
    nb_steps=_optional(_whole("Steps until the feet are side by side; null to walk on.", 1, MAX_TICK)),
    step_duration=_number(
        "Duration of the step under way [s]; if missing, that of the parameters.", *LIMITS["step_duration"]
    ),
    retiming=_optional(RETIMING),
)
PUSH_UNDER_WAY = _object(
    "Rest of a push that is under way.",
    ("impulse_per_tick", "ticks_left"),
    link=PUSH["properties"]["link"],
    point=PUSH["properties"]["point"],
    impulse_per_tick=_list(_number(), "World frame [N s].", 2, 2),
    ticks_left=_whole("Ticks that it still lasts.", 1, MAX_TICK),
)
HEIGHT = _number("Height of the sole above the ground [m].", 0.0, HIGHEST)
CONFIGURATION = _list(_number(low=-FARTHEST, high=FARTHEST), "Pinocchio's order; null for a robot without a body.")
PLANT = _complete(
    "State of the plant, of its sensors, and the limits that were reached lately; missing for the ideal plant.",
    numbers=_list(_number(), "Of MuJoCo, for the same build of it.", high=MAX_PLANT_NUMBERS),
    is_limp={"type": "boolean", "description": "Whether the servos are off."},
    standing=_list(_choice("Foot that stands.", ("left", "right")), high=2),
    estimate=_list(_number(low=-1e3, high=1e3), "CoM from the soles that stand, and its velocity.", 4, 4),
    delayed=_list(_list(_number(low=-10.0, high=10.0), low=2, high=2), "DCM errors on their way.", high=MAX_DELAYED),
    signs=_list(
        _complete(
            "A limit that was reached.",
            name=_choice("", tuple(SIGNS)),
            first=_whole("Tick.", 0, MAX_TICK),
            last=_whole("Tick.", 0, MAX_TICK),
        ),
        high=len(SIGNS),
    ),
    last_push=_optional(
        _complete(
            "Last push, for the words that tell a fall.",
            tick=_whole("", 0, MAX_TICK),
            forward=_number("[N s]", -1e4, 1e4),
            left=_number("[N s]", -1e4, 1e4),
            phase=_text("Of the gait."),
        )
    ),
)
STATE = _object(
    "State at which the walk begins, as a saved session has it; at rest at the origin if missing.",
    tuple(key for key in KEYS if key not in OPTIONAL_KEYS),
    tick=_whole("Ticks since the robot stood.", 0, MAX_TICK),
    gait=GAIT,
    flight=_optional(FLIGHT_UNDER_WAY),
    left_foot=_complete("Left sole, in the world frame.", **_vectors(FOOT), height=HEIGHT),
    right_foot=_complete("Right sole, in the world frame.", **_vectors(FOOT), height=HEIGHT),
    com=_complete("Centre of mass, in the world frame.", **_vectors(COM)),
    pushes=_list(PUSH_UNDER_WAY, "Pushes under way.", high=MAX_PUSHES),
    why_fallen=_text("Why the robot has fallen; empty while it is up."),
    com_offset=_complete("Offset of the dynamic filter.", **_vectors(OFFSET)),
    q=_optional(CONFIGURATION),
    q_before=_optional(CONFIGURATION),
    plant=_optional(PLANT),
    twin={"type": ["object", "null"], "description": "State of the ideal robot beside this one, with these same keys."},
)
SCENARIO: Json = {"title": "Scenario"} | _object(
    "A scripted walk: a robot, its parameters, references and pushes, and bounds on its metrics.",
    ("duration",),
    name=_text("Name of the scenario.", default="unnamed"),
    description=_text("What the scenario is for.", default=""),
    robot=_choice("Name of a robot that ships.", robot_names(), default=DEFAULT_ROBOT),
    duration=_number("Simulated time [s].", LIMITS["control_period"][0], MAX_DURATION),
    parameters=_optional(PARAMETERS),
    world=_optional(WORLD),
    initial_state=_optional(STATE),
    events=_optional(_list(EVENT, "Events in any order.")),
    expect=_optional(_expectations()),
)
