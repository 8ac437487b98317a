"""The plant and the world with which a live walk begins: contact physics where this machine keeps up."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Literal

from walkcore import Command, Parameters, Reference, Robot, Simulation
from walkcore.errors import InvalidValueError, WalkError
from walkcore.plant.world import PERFECT, World

PlantChoice = Literal["auto", "ideal", "mujoco"]
PHYSICS = "mujoco"
AS_CHOSEN = {"ideal": "the ideal model, as chosen", PHYSICS: "contact physics, as chosen"}
"""Why a plant moves that somebody has chosen."""
MEASURED_TICKS = 200
MEASURED_TIME = 1.0  # [s] after which a machine is known to be too slow
LARGEST_SHARE = 0.6  # of the period that the mean tick may take: the page needs the rest
WALKING = Command(Reference(vx=0.3))


def suitable_plant(
    robot: Robot,
    parameters: Parameters,
    choice: PlantChoice,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[Parameters, str]:
    """The parameters with the plant to begin with, and a sentence that tells why it is that one.

    Args:
        robot: to walk.
        parameters: of the walk.
        choice: a plant, or "auto", which measures some ticks with contact physics.
        clock: reads the time on the wall [s].
    """
    ideal = replace(parameters, plant="ideal")
    if choice == "ideal":
        return ideal, AS_CHOSEN[choice]
    physics = replace(parameters, plant=PHYSICS)
    try:
        simulation = Simulation(robot, physics)
    except WalkError as refusal:
        return ideal, f"the ideal model: {refusal}"
    if choice == PHYSICS:
        return physics, AS_CHOSEN[choice]
    mean, period = _mean_tick(simulation, clock), parameters.control_period
    measured = f"{1e3 * mean:.1f} of {1e3 * period:g} ms"
    if mean <= LARGEST_SHARE * period:
        return physics, f"contact physics: a tick takes {measured} on this machine"
    return ideal, f"the ideal model: with contact physics a tick would take {measured} on this machine"


def with_plant_and_world(
    parameters: Parameters, world: World, values: Mapping[str, Any], changes: Mapping[str, Any]
) -> tuple[Parameters, World]:
    """The parameters and the world of a walk that begins anew, with some of them changed.

    Args:
        parameters: in force.
        world: that the robot walks in.
        values: of parameters by name, the plant among them.
        changes: values of `World` by name; the ideal plant knows the perfect world only.

    Raises:
        WalkError: if that cannot be.
    """
    changed, changed_world = parameters.changed(values), world.changed(changes)
    parameters.check_change(replace(changed, plant=parameters.plant))
    if changed.plant != "ideal":
        return changed, changed_world
    if changes and changed_world != PERFECT:
        raise InvalidValueError("world", dict(changes), "needs plant: mujoco; the ideal plant has no other world")
    return changed, PERFECT


def _mean_tick(simulation: Simulation, clock: Callable[[], float]) -> float:
    """Mean time of the first ticks of a walk [s]."""
    started, nb_ticks = clock(), 0
    while nb_ticks < MEASURED_TICKS and clock() - started <= MEASURED_TIME:
        simulation.step(WALKING)
        nb_ticks += 1
    return (clock() - started) / nb_ticks
