"""JSON schema of a scenario, as documentation: only the core judges scenarios.

It is made from the core's own tables of parameters, limits and metrics, so that the two cannot drift apart. Limits that
depend on the robot, or on other values, are not in it.
"""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from app.descriptions import descriptions
from app.http.json_schema import Json, choice, complete, list_of, mapping, number, optional, text, whole
from walkcore import Parameters, robot_names
from walkcore.command import FARTHEST_POINT
from walkcore.mpc.schemes import DEPRECATED
from walkcore.parameters import CHOICES, COM_HEIGHT_LIMITS, LIMITS
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


def scenario_schema() -> Json:
    """The JSON schema of a scenario file."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | SCENARIO


def request_schema() -> Json:
    """The JSON schema of a scenario in a request, where a robot may be of the server's own folder, too."""
    robot = text("Name of one of `GET /api/v1/robots`.", default=DEFAULT_ROBOT)
    return SCENARIO | {"properties": SCENARIO["properties"] | {"robot": robot}}


def _vectors(vectors: Mapping[str, tuple[int, float]]) -> dict[str, Json]:
    """Vectors by their names, each with its number of components and their limit."""
    return {
        name: list_of(number(low=-limit, high=limit), low=size, high=size) for name, (size, limit) in vectors.items()
    }


def _parameters() -> Json:
    described = descriptions(Parameters)
    members = {field.name: _parameter(field.name, described[field.name], field.default) for field in fields(Parameters)}
    return mapping("Parameters of the walk; a missing one has its default.", **members)


def _parameter(name: str, description: str, default: Any) -> Json:
    if name in CHOICES:
        deprecated = DEPRECATED if name == "scheme" else ()
        return choice(description, (*CHOICES[name], *deprecated), default=default)
    if name == "com_height":
        return optional(number(description, *COM_HEIGHT_LIMITS, default=default))
    if name not in LIMITS:
        return {"type": "boolean", "description": description, "default": default}
    return (whole if isinstance(default, int) else number)(description, *LIMITS[name], default=default)


def _expectations() -> Json:
    bounds = {
        f"{side}_{metric}": number(f"{words}: {meaning}.")
        for metric, meaning in METRICS.items()
        for side, words in (("max", "At most"), ("min", "At least"))
    }
    not_fallen: Json = {"type": "boolean", "description": "Whether the robot stays up."}
    return mapping("Bounds on metrics: a run that breaks one fails.", not_fallen=not_fallen, **bounds)


PARAMETERS = _parameters()
REFERENCE = mapping(
    "Requested velocity of the CoM, in the robot's heading frame; a missing component is zero. The robot limits it.",
    vx=number("Forward [m/s].", default=0.0),
    vy=number("To the left [m/s].", default=0.0),
    yaw_rate=number("Counter-clockwise [rad/s].", default=0.0),
)
PUSH = mapping(
    "An impulse on the CoM; the robot limits its strength.",
    ("impulse",),
    impulse=list_of(number(), "[N s]", 2, 2),
    duration=number("[s]; zero gives it all in one tick.", 0.0, 10.0, default=0.0),
    frame=choice("Frame of the impulse.", ("robot", "world"), default="robot"),
    link=text("Joint whose link is pushed; empty for the torso. The ideal plant is pushed at its CoM.", default=""),
    point=optional(
        list_of(number("", -FARTHEST_POINT, FARTHEST_POINT), "On that link, in its joint's frame [m].", 3, 3)
    ),
)
EVENT = mapping(
    "Changes at one time.",
    ("t",),
    t=number("Time from the beginning, up to the scenario's end [s].", 0.0, MAX_DURATION),
    reference=REFERENCE | {"description": f"{REFERENCE['description']} It holds until the next one."},
    over=number("Time that the reference takes to get there, by a ramp [s].", 0.0, MAX_DURATION, default=0.0),
    push=PUSH,
    parameters=PARAMETERS | {"description": "Parameters that change, from then on."},
    solves_in_time=optional(
        whole("Solves that this one tick of a saved live walk had the time for; null for all.", 0, MAX_SOLVES)
    ),
)
RETIMING = complete(
    "Other durations than those of the parameters, chosen by adaptive step timing; null for none.",
    offset=whole("Ticks from the sample `start` to the beginning of the first step.", 0, MAX_TICK),
    first_step_ticks=whole("Duration of the first step in ticks.", 2, MAX_TICK),
    samples_per_step=whole("Samples that each step after it takes.", 2, MAX_SAMPLES),
)
FLIGHT_UNDER_WAY = complete(
    "Height of a foot whose touchdown was moved while it was in the air; null for none.",
    start=whole("Tick at which the touchdown was moved.", 0, MAX_TICK),
    touchdown=whole("Tick of the new one.", 0, MAX_TICK),
    **{name: number("At the start, in SI units.", low, high) for name, (low, high) in FLIGHT.items()},
)
WORLD = mapping(
    "World that contact physics stands in; needs parameters.plant: mujoco.",
    **{
        field.name: choice(described, SENSORS, default=field.default)
        if field.name == "sensors"
        else whole(described, 0, MAX_SEED, default=field.default)
        if field.name == "seed"
        else number(described, *WORLD_LIMITS[field.name], default=field.default)
        for field, described in ((field, descriptions(World)[field.name]) for field in fields(World))
    },
)
GAIT = mapping(
    "Position of the robot in its steps.",
    ("first_support", "start", "nb_steps"),
    first_support=choice("Foot that carried the first step.", ("left", "right")),
    start=optional(whole("Sample at which the first step began; null to stand.", 0, MAX_TICK)),
    nb_steps=optional(whole("Steps until the feet are side by side; null to walk on.", 1, MAX_TICK)),
    step_duration=number(
        "Duration of the step under way [s]; if missing, that of the parameters.", *LIMITS["step_duration"]
    ),
    retiming=optional(RETIMING),
)
PUSH_UNDER_WAY = mapping(
    "Rest of a push that is under way.",
    ("impulse_per_tick", "ticks_left"),
    link=PUSH["properties"]["link"],
    point=PUSH["properties"]["point"],
    impulse_per_tick=list_of(number(), "World frame [N s].", 2, 2),
    ticks_left=whole("Ticks that it still lasts.", 1, MAX_TICK),
)
HEIGHT = number("Height of the sole above the ground [m].", 0.0, HIGHEST)
CONFIGURATION = list_of(number(low=-FARTHEST, high=FARTHEST), "Pinocchio's order; null for a robot without a body.")
PLANT = complete(
    "State of the plant, of its sensors, and the limits that were reached lately; missing for the ideal plant.",
    numbers=list_of(number(), "Of MuJoCo, for the same build of it.", high=MAX_PLANT_NUMBERS),
    is_limp={"type": "boolean", "description": "Whether the servos are off."},
    standing=list_of(choice("Foot that stands.", ("left", "right")), high=2),
    estimate=list_of(number(low=-1e3, high=1e3), "CoM from the soles that stand, and its velocity.", 4, 4),
    delayed=list_of(list_of(number(low=-10.0, high=10.0), low=2, high=2), "DCM errors on their way.", high=MAX_DELAYED),
    signs=list_of(
        complete(
            "A limit that was reached.",
            name=choice("", tuple(SIGNS)),
            first=whole("Tick.", 0, MAX_TICK),
            last=whole("Tick.", 0, MAX_TICK),
        ),
        high=len(SIGNS),
    ),
    last_push=optional(
        complete(
            "Last push, for the words that tell a fall.",
            tick=whole("", 0, MAX_TICK),
            forward=number("[N s]", -1e4, 1e4),
            left=number("[N s]", -1e4, 1e4),
            phase=text("Of the gait."),
        )
    ),
)
STATE = mapping(
    "State at which the walk begins, as a saved session has it; at rest at the origin if missing.",
    tuple(key for key in KEYS if key not in OPTIONAL_KEYS),
    tick=whole("Ticks since the robot stood.", 0, MAX_TICK),
    gait=GAIT,
    flight=optional(FLIGHT_UNDER_WAY),
    left_foot=complete("Left sole, in the world frame.", **_vectors(FOOT), height=HEIGHT),
    right_foot=complete("Right sole, in the world frame.", **_vectors(FOOT), height=HEIGHT),
    com=complete("Centre of mass, in the world frame.", **_vectors(COM)),
    pushes=list_of(PUSH_UNDER_WAY, "Pushes under way.", high=MAX_PUSHES),
    why_fallen=text("Why the robot has fallen; empty while it is up."),
    com_offset=complete("Offset of the dynamic filter.", **_vectors(OFFSET)),
    q=optional(CONFIGURATION),
    q_before=optional(CONFIGURATION),
    plant=optional(PLANT),
    twin={"type": ["object", "null"], "description": "State of the ideal robot beside this one, with these same keys."},
)
SCENARIO: Json = {"title": "Scenario"} | mapping(
    "A scripted walk: a robot, its parameters, references and pushes, and bounds on its metrics.",
    ("duration",),
    name=text("Name of the scenario.", default="unnamed"),
    description=text("What the scenario is for.", default=""),
    robot=choice("Name of a robot that ships.", robot_names(), default=DEFAULT_ROBOT),
    duration=number("Simulated time [s].", LIMITS["control_period"][0], MAX_DURATION),
    parameters=optional(PARAMETERS),
    world=optional(WORLD),
    initial_state=optional(STATE),
    events=optional(list_of(EVENT, "Events in any order.")),
    expect=optional(_expectations()),
)
