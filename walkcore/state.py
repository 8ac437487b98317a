"""The state of a walk between two ticks: a value that can be kept, sent, and walked on from."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from walkcore.errors import InvalidValueError
from walkcore.model import ModelState
from walkcore.motion.dynamic_filter import Offset
from walkcore.motion.swing_foot import Flight, FootState
from walkcore.mpc.gait import Gait, Retiming, Timing
from walkcore.mpc.lipm import CoMState
from walkcore.parameters import LIMITS, Parameters
from walkcore.plant.driver_state import DriverState, driver_state_from_mapping, side_from_name
from walkcore.pushes import PushUnderWay, pushes_from_list
from walkcore.robot import Robot
from walkcore.values import (
    FARTHEST,
    MAX_TICK,
    Vector,
    check_complete,
    check_mapping,
    check_range,
    check_vector,
    check_whole,
)

HIGHEST = 1.0  # [m] of a foot in the air
MAX_SAMPLES = 64  # of a step


@dataclass(frozen=True, slots=True, eq=False)
class SimulationState:
    """The state between two ticks, which with the robot, the parameters and the commands decides all that follows."""

    model: ModelState
    pushes: tuple[PushUnderWay, ...]
    why_fallen: str
    """Empty while the robot is on its feet."""
    driver: DriverState | None
    """State of the driven body; None for a robot without a body."""
    twin: "SimulationState | None" = None
    """State of the ideal robot that walks beside this one, where one does."""

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, from which `state_from_mapping` makes the same state to the last bit."""
        model, gait = self.model, self.model.gait
        return {
            "tick": model.tick,
            "gait": {
                "first_support": gait.first_support.name.lower(),
                "start": None if gait.start is None else int(gait.start),
                "nb_steps": None if gait.nb_steps is None else int(gait.nb_steps),
                "step_duration": gait.timing.step_duration,
                "retiming": None if gait.retiming is None else asdict(gait.retiming),
            },
            "flight": None if model.flight is None else asdict(model.flight),
            "com": _plain(model.com, COM),
            "left_foot": _plain(model.left_foot, FOOT) | {"height": float(model.left_foot.height)},
            "right_foot": _plain(model.right_foot, FOOT) | {"height": float(model.right_foot.height)},
            "pushes": [push.to_mapping() for push in self.pushes],
            "why_fallen": self.why_fallen,
            "com_offset": {
                "position": model.com_offset.position.tolist(),
                "divergent": model.com_offset.dcm.tolist(),
            },
            **({"q": None, "q_before": None} if self.driver is None else self.driver.to_mapping()),
            **({} if self.twin is None else {"twin": self.twin.to_mapping()}),
        }


# The vectors of each part, by how many numbers and how large they may be, and the numbers of a flight.
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
    values = check_complete("initial_state", dict(OPTIONAL_KEYS) | check_mapping("initial_state", data), KEYS)
    tick = check_whole("initial_state.tick", values["tick"], 0, MAX_TICK)
    if not isinstance(values["why_fallen"], str):
        raise InvalidValueError("initial_state.why_fallen", values["why_fallen"], "must be text")
    model = ModelState(
        tick=tick,
        gait=_gait(values["gait"], None if values["why_fallen"] else tick, parameters),
        flight=_flight(values["flight"], tick),
        left_foot=_foot("initial_state.left_foot", values["left_foot"]),
        right_foot=_foot("initial_state.right_foot", values["right_foot"]),
        com=CoMState(np.array(list(_vectors("initial_state.com", values["com"], COM).values()))),
        com_offset=Offset(*_vectors("initial_state.com_offset", values["com_offset"], OFFSET).values()),
    )
    return SimulationState(
        model=model,
        pushes=pushes_from_list("initial_state.pushes", values["pushes"], robot),
        why_fallen=values["why_fallen"],
        driver=driver_state_from_mapping("initial_state", values, robot),
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


def _vectors(where: str, data: Any, vectors: Mapping[str, tuple[int, float]]) -> dict[str, Vector]:
    values = check_complete(where, data, tuple(vectors))
    return {
        name: check_vector(f"{where}.{name}", values[name], size, -limit, limit)
        for name, (size, limit) in vectors.items()
    }


def _foot(where: str, data: Any) -> FootState:
    values = check_complete(where, data, (*FOOT, "height"))
    height = check_range(f"{where}.height", values.pop("height"), 0.0, HIGHEST)
    return FootState(np.array(list(_vectors(where, values, FOOT).values())), height)


def _gait(data: Any, tick: int | None, parameters: Parameters) -> Gait:
    """The gait; at a tick it may not have ended, but for None, after a fall, from which on it stays as it was."""
    where = "initial_state.gait"
    timing = {"step_duration": parameters.step_duration, "retiming": None}
    values = check_complete(where, timing | check_mapping(where, data), ("first_support", "start", "nb_steps", *timing))
    side, start, nb_steps = (values[key] for key in ("first_support", "start", "nb_steps"))
    first_support = side_from_name(f"{where}.first_support", side)
    if start is not None:
        check_whole(f"{where}.start", start, 0, MAX_TICK)
    if nb_steps is not None:
        check_whole(f"{where}.nb_steps", nb_steps, 1, MAX_TICK)
    if nb_steps is not None and start is None:
        raise InvalidValueError(f"{where}.nb_steps", nb_steps, "must be null where start is null")
    retiming = _retiming(values["retiming"], start, parameters)
    gait = Gait(_timing(parameters, values["step_duration"]), first_support, start, nb_steps, retiming)
    if tick is not None and gait.has_ended(tick):
        raise InvalidValueError(f"{where}.nb_steps", nb_steps, "must be more than the steps that have been taken")
    return gait


def _retiming(data: Any, start: Any, parameters: Parameters) -> Retiming | None:
    where, per_sample = "initial_state.gait.retiming", parameters.timing.ticks_per_sample
    if data is None:
        return None
    if start is None:
        raise InvalidValueError(where, cast(object, data), "must be null where start is null")
    values = check_complete(where, data, ("offset", "first_step_ticks", "samples_per_step"))
    return Retiming(
        offset=check_whole(f"{where}.offset", values["offset"], 0, per_sample - 1),
        first_step_ticks=check_whole(f"{where}.first_step_ticks", values["first_step_ticks"], per_sample + 1, MAX_TICK),
        samples_per_step=check_whole(f"{where}.samples_per_step", values["samples_per_step"], 2, MAX_SAMPLES),
    )


def _flight(data: Any, tick: int) -> Flight | None:
    where = "initial_state.flight"
    if data is None:
        return None
    values = check_complete(where, data, ("start", "touchdown", *FLIGHT))
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
