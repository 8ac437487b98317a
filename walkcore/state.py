"""The state of a walk between two ticks: a value that can be kept, sent, and walked on from."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from walkcore.command import FARTHEST_POINT
from walkcore.errors import InvalidValueError
from walkcore.motion.dynamic_filter import Offset
from walkcore.motion.swing_foot import Flight, FootState
from walkcore.motion.whole_body import configuration_size
from walkcore.mpc.gait import Gait, Retiming, Timing
from walkcore.mpc.lipm import CoMState
from walkcore.mpc.stance import Side
from walkcore.parameters import LIMITS, Parameters
from walkcore.plant.driver import DriverState, SensorState
from walkcore.plant.fall_watch import SIGNS, FallSigns, LastPush, Sign
from walkcore.plant.plant import PlantState
from walkcore.plant.sensors import Estimate
from walkcore.robot import Robot
from walkcore.values import (
    Vector,
    check_keys,
    check_mapping,
    check_range,
    check_text,
    check_vector,
    check_whole,
    frozen_copy,
)

MAX_TICK = 10**9
FARTHEST = 1e5  # [m] from the origin
HIGHEST = 1.0  # [m] of a foot in the air
MAX_SAMPLES = 64  # of a step
MAX_PUSHES = 1000  # under way at once
QUATERNION_TOLERANCE = 1e-6
ROUNDING = 1e-9  # by which a push may exceed the strongest one
MAX_PLANT_NUMBERS = 1000


@dataclass(frozen=True, slots=True, eq=False)
class PushUnderWay:
    """The rest of a push."""

    impulse_per_tick: Vector
    """World frame [N s], shape (2,)."""
    ticks_left: int
    link: str = ""
    """As of `Push`."""
    point: Vector | None = None
    """As of `Push`."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "impulse_per_tick", frozen_copy(self.impulse_per_tick, shape=(2,)))


@dataclass(frozen=True, slots=True, eq=False)
class SimulationState:
    """The state between two ticks, which with the robot, the parameters and the commands decides all that follows."""

    tick: int
    """The coming tick."""
    gait: Gait
    flight: Flight | None
    """Height of the foot in the air, where its touchdown was moved."""
    left_foot: FootState
    right_foot: FootState
    com: CoMState
    pushes: tuple[PushUnderWay, ...]
    why_fallen: str
    """Empty while the robot is on its feet."""
    com_offset: Offset
    """Offset of the body's CoM from the model's."""
    driver: DriverState | None
    """State of the driven body; None for a robot without a body."""
    twin: "SimulationState | None" = None
    """State of the ideal robot that walks beside this one, where one does."""

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, from which `state_from_mapping` makes the same state to the last bit."""
        plant, twin = None if self.driver is None else _plain_plant(self.driver), self.twin
        return (
            {
                "tick": self.tick,
                "gait": {
                    "first_support": self.gait.first_support.name.lower(),
                    "start": None if self.gait.start is None else int(self.gait.start),
                    "nb_steps": None if self.gait.nb_steps is None else int(self.gait.nb_steps),
                    "step_duration": self.gait.timing.step_duration,
                    "retiming": None if self.gait.retiming is None else asdict(self.gait.retiming),
                },
                "flight": None if self.flight is None else asdict(self.flight),
                "com": _plain(self.com, COM),
                "left_foot": _plain(self.left_foot, FOOT) | {"height": float(self.left_foot.height)},
                "right_foot": _plain(self.right_foot, FOOT) | {"height": float(self.right_foot.height)},
                "pushes": [
                    {"impulse_per_tick": push.impulse_per_tick.tolist(), "ticks_left": push.ticks_left}
                    | ({"link": push.link} if push.link else {})
                    | ({} if push.point is None else {"point": push.point.tolist()})
                    for push in self.pushes
                ],
                "why_fallen": self.why_fallen,
                "com_offset": {
                    "position": self.com_offset.position.tolist(),
                    "divergent": self.com_offset.dcm.tolist(),
                },
                "q": None if self.driver is None else self.driver.q.tolist(),
                "q_before": None if self.driver is None else self.driver.q_before.tolist(),
            }
            | ({} if plant is None else {"plant": plant})
            | ({} if twin is None else {"twin": twin.to_mapping()})
        )


# The vectors of each part: how many numbers, and how large they may be.
COM = {"position": (2, FARTHEST), "velocity": (2, 1e3), "acceleration": (2, 1e4)}
FOOT = {"pose": (3, FARTHEST), "velocity": (3, 1e3), "acceleration": (3, 1e5)}
OFFSET = {"position": (2, 10.0), "divergent": (2, 10.0)}  # the older name of its DCM, which saved sessions have


FLIGHT = {"height": (0.0, HIGHEST), "velocity": (-1e2, 1e2), "acceleration": (-1e4, 1e4), "bump": (0.0, HIGHEST)}


def state_from_mapping(data: Any, robot: Robot, parameters: Parameters) -> SimulationState:
    """A state from the plain values of `SimulationState.to_mapping`.

    Args:
        data: as YAML or JSON gives it.
        robot: that is in this state.
        parameters: in force at that tick.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
    """
    values = _complete("initial_state", dict(OPTIONAL_KEYS) | check_mapping("initial_state", data), KEYS)
    tick = check_whole("initial_state.tick", values["tick"], 0, MAX_TICK)
    if not isinstance(values["why_fallen"], str):
        raise InvalidValueError("initial_state.why_fallen", values["why_fallen"], "must be text")
    return SimulationState(
        tick=tick,
        gait=_gait(values["gait"], None if values["why_fallen"] else tick, parameters),
        flight=_flight(values["flight"], tick),
        left_foot=_foot("initial_state.left_foot", values["left_foot"]),
        right_foot=_foot("initial_state.right_foot", values["right_foot"]),
        com=CoMState(np.array(list(_vectors("initial_state.com", values["com"], COM).values()))),
        pushes=_pushes(values["pushes"], robot),
        why_fallen=values["why_fallen"],
        com_offset=Offset(*_vectors("initial_state.com_offset", values["com_offset"], OFFSET).values()),
        driver=_driver(values, robot),
        twin=None if values["twin"] is None else state_from_mapping(values["twin"], robot, parameters),
    )


KEYS = (
    *("tick", "gait", "flight", "left_foot", "right_foot", "com", "pushes"),
    *("why_fallen", "com_offset", "q", "q_before", "plant", "twin"),
)
OPTIONAL_KEYS: Mapping[str, None] = MappingProxyType({"flight": None, "plant": None, "twin": None})
"""Keys that older sessions, and most states, do not have."""


def _plain(part: CoMState | FootState, vectors: Mapping[str, Any]) -> dict[str, Any]:
    return {name: getattr(part, name).tolist() for name in vectors}


def _complete(where: str, data: Any, keys: tuple[str, ...]) -> dict[str, Any]:
    """A mapping that has all of the keys and no other."""
    values = check_mapping(where, data)
    check_keys(where, values, set(keys))
    for key in keys:
        if key not in values:
            raise InvalidValueError(f"{where}.{key}", None, "is missing")
    return values


def _vectors(where: str, data: Any, vectors: Mapping[str, tuple[int, float]]) -> dict[str, Vector]:
    values = _complete(where, data, tuple(vectors))
    return {
        name: check_vector(f"{where}.{name}", values[name], size, -limit, limit)
        for name, (size, limit) in vectors.items()
    }


def _foot(where: str, data: Any) -> FootState:
    values = _complete(where, data, (*FOOT, "height"))
    height = check_range(f"{where}.height", values.pop("height"), 0.0, HIGHEST)
    return FootState(np.array(list(_vectors(where, values, FOOT).values())), height)


def _gait(data: Any, tick: int | None, parameters: Parameters) -> Gait:
    """The gait; at a tick it may not have ended, but for None, after a fall, from which on it stays as it was."""
    where = "initial_state.gait"
    timing = {"step_duration": parameters.step_duration, "retiming": None}
    values = _complete(where, timing | check_mapping(where, data), ("first_support", "start", "nb_steps", *timing))
    sides = {side.name.lower(): side for side in Side}
    side, start, nb_steps = (values[key] for key in ("first_support", "start", "nb_steps"))
    if side not in ("left", "right"):
        raise InvalidValueError(f"{where}.first_support", side, "must be 'left' or 'right'")
    if start is not None:
        check_whole(f"{where}.start", start, 0, MAX_TICK)
    if nb_steps is not None:
        check_whole(f"{where}.nb_steps", nb_steps, 1, MAX_TICK)
    if nb_steps is not None and start is None:
        raise InvalidValueError(f"{where}.nb_steps", nb_steps, "must be null where start is null")
    retiming = _retiming(values["retiming"], start, parameters)
    gait = Gait(_timing(parameters, values["step_duration"]), sides[side], start, nb_steps, retiming)
    if tick is not None and gait.has_ended(tick):
        raise InvalidValueError(f"{where}.nb_steps", nb_steps, "must be more than the steps that have been taken")
    return gait


def _retiming(data: Any, start: Any, parameters: Parameters) -> Retiming | None:
    where, per_sample = "initial_state.gait.retiming", parameters.timing.ticks_per_sample
    if data is None:
        return None
    if start is None:
        raise InvalidValueError(where, cast(object, data), "must be null where start is null")
    values = _complete(where, data, ("offset", "first_step_ticks", "samples_per_step"))
    return Retiming(
        offset=check_whole(f"{where}.offset", values["offset"], 0, per_sample - 1),
        first_step_ticks=check_whole(f"{where}.first_step_ticks", values["first_step_ticks"], per_sample + 1, MAX_TICK),
        samples_per_step=check_whole(f"{where}.samples_per_step", values["samples_per_step"], 2, MAX_SAMPLES),
    )


def _flight(data: Any, tick: int) -> Flight | None:
    where = "initial_state.flight"
    if data is None:
        return None
    values = _complete(where, data, ("start", "touchdown", *FLIGHT))
    return Flight(
        start=check_whole(f"{where}.start", values["start"], 0, tick),
        touchdown=check_whole(f"{where}.touchdown", values["touchdown"], tick + 1, MAX_TICK),
        **{name: check_range(f"{where}.{name}", values[name], low, high) for name, (low, high) in FLIGHT.items()},
    )


def _timing(parameters: Parameters, step_duration: Any) -> Timing:
    """The timing of a step under way, which keeps its duration when another one is requested."""
    where = "initial_state.gait.step_duration"
    check_range(where, step_duration, *LIMITS["step_duration"])
    samples = step_duration / parameters.sampling_period
    if abs(samples - round(samples)) > 1e-9 or round(samples) < 2:
        limit = f"must be a multiple of sampling_period = {parameters.sampling_period:g}, and at least two of them"
        raise InvalidValueError(where, step_duration, limit)
    return replace(parameters.timing, step_duration=step_duration)


def _pushes(data: Any, robot: Robot) -> tuple[PushUnderWay, ...]:
    where = "initial_state.pushes"
    if not isinstance(data, list) or len(cast(list[Any], data)) > MAX_PUSHES:
        raise InvalidValueError(where, cast(object, data), f"must be a list of at most {MAX_PUSHES}")
    pushes: list[PushUnderWay] = []
    for i, item in enumerate(cast(list[Any], data)):
        item = {"link": "", "point": None} | check_mapping(f"{where}[{i}]", item)
        values = _complete(f"{where}[{i}]", item, ("impulse_per_tick", "ticks_left", "link", "point"))
        limit, point = robot.max_push * (1.0 + ROUNDING), values["point"]
        if point is not None:
            point = check_vector(f"{where}[{i}].point", point, 3, -FARTHEST_POINT, FARTHEST_POINT)
        impulse = check_vector(f"{where}[{i}].impulse_per_tick", values["impulse_per_tick"], 2, -limit, limit)
        ticks_left = check_whole(f"{where}[{i}].ticks_left", values["ticks_left"], 1, MAX_TICK)
        pushes.append(PushUnderWay(impulse, ticks_left, check_text(f"{where}[{i}].link", values["link"]), point))
    return tuple(pushes)


def _plain_plant(state: DriverState) -> dict[str, Any] | None:
    """Plain values of the plant of a driven body, its sensors and the signs of a fall; None for the ideal one."""
    if not len(state.plant.numbers):
        return None
    estimate, push = state.sensors.estimate, state.signs.push
    return {
        "numbers": state.plant.numbers.tolist(),
        "is_limp": state.plant.is_limp,
        "standing": [side.name.lower() for side in estimate.standing],
        "estimate": [*estimate.com.tolist(), *estimate.velocity.tolist()],
        "delayed": [error.tolist() for error in state.sensors.delayed],
        "signs": [asdict(sign) for sign in state.signs.signs],
        "last_push": None if push is None else asdict(push),
    }


PLANT_KEYS = ("numbers", "is_limp", "standing", "estimate", "delayed", "signs", "last_push")
MAX_DELAYED = 100  # measurements on their way


def _driver(values: Mapping[str, Any], robot: Robot) -> DriverState | None:
    q, q_before = (_configuration(f"initial_state.{name}", values[name], robot) for name in ("q", "q_before"))
    if q is None or q_before is None:
        return None
    where, data = "initial_state.plant", values["plant"]
    if data is None:
        return DriverState(q, q_before)
    plant = _complete(where, data, PLANT_KEYS)
    if not isinstance(plant["is_limp"], bool):
        raise InvalidValueError(f"{where}.is_limp", plant["is_limp"], "must be true or false")
    numbers = _list(f"{where}.numbers", plant["numbers"], MAX_PLANT_NUMBERS)
    standing = [
        _side(f"{where}.standing[{i}]", name) for i, name in enumerate(_list(f"{where}.standing", plant["standing"], 2))
    ]
    estimate = check_vector(f"{where}.estimate", plant["estimate"], 4, -1e3, 1e3)
    delayed = _list(f"{where}.delayed", plant["delayed"], MAX_DELAYED)
    return DriverState(
        q,
        q_before,
        PlantState(check_vector(f"{where}.numbers", numbers, len(numbers)), plant["is_limp"]),
        SensorState(
            Estimate(tuple(standing), estimate[:2], estimate[2:]),
            tuple(check_vector(f"{where}.delayed[{i}]", error, 2, -10.0, 10.0) for i, error in enumerate(delayed)),
        ),
        _signs(where, plant),
    )


def _signs(where: str, plant: Mapping[str, Any]) -> FallSigns:
    signs: list[Sign] = []
    for i, item in enumerate(_list(f"{where}.signs", plant["signs"], len(SIGNS))):
        place = f"{where}.signs[{i}]"
        sign = _complete(place, item, ("name", "first", "last"))
        if sign["name"] not in SIGNS:
            raise InvalidValueError(f"{place}.name", sign["name"], f"must be one of {', '.join(SIGNS)}")
        first, last = (check_whole(f"{place}.{name}", sign[name], 0, MAX_TICK) for name in ("first", "last"))
        signs.append(Sign(sign["name"], first, last))
    if plant["last_push"] is None:
        return FallSigns(tuple(signs))
    place = f"{where}.last_push"
    push = _complete(place, plant["last_push"], ("tick", "forward", "left", "phase"))
    forward, left = (check_range(f"{place}.{name}", push[name], -1e4, 1e4) for name in ("forward", "left"))
    check_text(f"{place}.phase", push["phase"])
    last = LastPush(check_whole(f"{place}.tick", push["tick"], 0, MAX_TICK), forward, left, push["phase"])
    return FallSigns(tuple(signs), last)


def _side(where: str, value: Any) -> Side:
    names = [side.name.lower() for side in Side]
    if value not in names:
        raise InvalidValueError(where, value, f"must be one of {', '.join(names)}")
    return Side[str(value).upper()]


def _list(where: str, value: Any, longest: int) -> list[Any]:
    if not isinstance(value, list) or len(cast(list[Any], value)) > longest:
        raise InvalidValueError(where, cast(object, value), f"must be a list of at most {longest}")
    return cast(list[Any], value)


def _configuration(where: str, data: Any, robot: Robot) -> Vector | None:
    if robot.body is None:
        if data is not None:
            raise InvalidValueError(where, data, f"must be null: {robot.name} has no body")
        return None
    q = check_vector(where, data, configuration_size(robot.body), -FARTHEST, FARTHEST)
    if abs(float(q[3:7] @ q[3:7]) - 1.0) > QUATERNION_TOLERANCE:
        raise InvalidValueError(f"{where}[3:7]", q[3:7].tolist(), "must be a unit quaternion")
    return q
