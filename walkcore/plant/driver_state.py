"""The state of a driven body between two ticks, and its plain values."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from walkcore.errors import InvalidValueError
from walkcore.motion.body_model import configuration_size
from walkcore.mpc.stance import Side
from walkcore.plant.fall_watch import SIGNS, FallSigns, LastPush, Sign
from walkcore.plant.plant import PlantState
from walkcore.plant.sensors import Estimate
from walkcore.robot import Robot
from walkcore.values import (
    FARTHEST,
    MAX_TICK,
    Vector,
    check_choice,
    check_complete,
    check_flag,
    check_list,
    check_range,
    check_text,
    check_vector,
    check_whole,
)

PLANT_KEYS = ("numbers", "is_limp", "standing", "estimate", "delayed", "signs", "last_push")
MAX_PLANT_NUMBERS = 1000
MAX_DELAYED = 100  # measurements on their way
QUATERNION_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class SensorState:
    """The memory of the sensors between two ticks."""

    estimate: Estimate = field(default_factory=Estimate)
    delayed: tuple[Vector, ...] = ()
    """DCM errors that have been measured and not yet been passed on, the oldest first [m], each of shape (2,)."""


@dataclass(frozen=True, slots=True, eq=False)
class DriverState:
    """The state of a driven body between two ticks."""

    q: Vector
    """Commanded configuration at the coming tick, in Pinocchio's order, shape (nq,)."""
    q_before: Vector
    """Commanded configuration one tick earlier, shape (nq,)."""
    plant: PlantState = field(default_factory=PlantState)
    sensors: SensorState = field(default_factory=SensorState)
    signs: FallSigns = field(default_factory=FallSigns)

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, from which `driver_state_from_mapping` makes the same; without the plant if it is ideal."""
        configurations = {"q": self.q.tolist(), "q_before": self.q_before.tolist()}
        if not len(self.plant.numbers):
            return configurations
        estimate, push = self.sensors.estimate, self.signs.push
        plant = {
            "numbers": self.plant.numbers.tolist(),
            "is_limp": self.plant.is_limp,
            "standing": [side.name.lower() for side in estimate.standing],
            "estimate": [*estimate.com.tolist(), *estimate.velocity.tolist()],
            "delayed": [error.tolist() for error in self.sensors.delayed],
            "signs": [asdict(sign) for sign in self.signs.signs],
            "last_push": None if push is None else asdict(push),
        }
        return configurations | {"plant": plant}


def driver_state_from_mapping(where: str, values: Mapping[str, Any], robot: Robot) -> DriverState | None:
    """The state from plain values; None for a robot without a body.

    Args:
        where: their name in an error.
        values: with the keys `q`, `q_before` and `plant`.
        robot: whose body it is.

    Raises:
        InvalidValueError: naming the field, its value and its limit.
    """
    q, q_before = (_configuration(f"{where}.{name}", values[name], robot) for name in ("q", "q_before"))
    if q is None or q_before is None:
        return None
    if values["plant"] is None:
        return DriverState(q, q_before)
    where = f"{where}.plant"
    plant = check_complete(where, values["plant"], PLANT_KEYS)
    numbers = check_list(f"{where}.numbers", plant["numbers"], MAX_PLANT_NUMBERS)
    standing = check_list(f"{where}.standing", plant["standing"], 2)
    estimate = check_vector(f"{where}.estimate", plant["estimate"], 4, -1e3, 1e3)
    delayed = check_list(f"{where}.delayed", plant["delayed"], MAX_DELAYED)
    return DriverState(
        q,
        q_before,
        PlantState(
            check_vector(f"{where}.numbers", numbers, len(numbers)), check_flag(f"{where}.is_limp", plant["is_limp"])
        ),
        SensorState(
            Estimate(
                tuple(side_from_name(f"{where}.standing[{i}]", name) for i, name in enumerate(standing)),
                estimate[:2],
                estimate[2:],
            ),
            tuple(check_vector(f"{where}.delayed[{i}]", error, 2, -10.0, 10.0) for i, error in enumerate(delayed)),
        ),
        _signs(where, plant),
    )


def _signs(where: str, plant: Mapping[str, Any]) -> FallSigns:
    signs: list[Sign] = []
    for i, item in enumerate(check_list(f"{where}.signs", plant["signs"], len(SIGNS))):
        place = f"{where}.signs[{i}]"
        sign = check_complete(place, item, ("name", "first", "last"))
        first, last = (check_whole(f"{place}.{name}", sign[name], 0, MAX_TICK) for name in ("first", "last"))
        signs.append(Sign(check_choice(f"{place}.name", sign["name"], SIGNS), first, last))
    if plant["last_push"] is None:
        return FallSigns(tuple(signs))
    place = f"{where}.last_push"
    push = check_complete(place, plant["last_push"], ("tick", "forward", "left", "phase"))
    forward, left = (check_range(f"{place}.{name}", push[name], -1e4, 1e4) for name in ("forward", "left"))
    check_text(f"{place}.phase", push["phase"])
    last = LastPush(check_whole(f"{place}.tick", push["tick"], 0, MAX_TICK), forward, left, push["phase"])
    return FallSigns(tuple(signs), last)


def side_from_name(where: str, value: Any) -> Side:
    """The side that a plain value names.

    Raises:
        InvalidValueError: if it names none.
    """
    return Side[check_choice(where, value, [side.name.lower() for side in Side]).upper()]


def _configuration(where: str, data: Any, robot: Robot) -> Vector | None:
    if robot.body is None:
        if data is not None:
            raise InvalidValueError(where, data, f"must be null: {robot.name} has no body")
        return None
    q = check_vector(where, data, configuration_size(robot.body), -FARTHEST, FARTHEST)
    if abs(float(q[3:7] @ q[3:7]) - 1.0) > QUATERNION_TOLERANCE:
        raise InvalidValueError(f"{where}[3:7]", q[3:7].tolist(), "must be a unit quaternion")
    return q
