"""A walk that was driven live, as a scenario: replayed, it decides the same, tick for tick."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from walkcore.command import Command, Push, Reference
from walkcore.parameters import Parameters
from walkcore.plant.world import PERFECT, World
from walkcore.robot import Robot
from walkcore.state import SimulationState


def session_scenario(
    name: str,
    robot: Robot,
    parameters: Parameters,
    state: SimulationState,
    commands: Sequence[Command],
    changes: Mapping[int, Parameters],
    world: World = PERFECT,
    solves_in_time: Mapping[int, int] = MappingProxyType({}),
) -> dict[str, Any]:
    """The mapping of a scenario, for `scenario_from_mapping`.

    Args:
        name: of the scenario.
        robot: that walked.
        parameters: in force before the first command.
        state: before the first command.
        commands: one a tick.
        changes: parameters that came into force just before a command, by its index.
        world: that the plant stood in.
        solves_in_time: of the commands whose tick had no time for all of its solves, by their index.
    """
    events: list[dict[str, Any]] = []
    reference, in_force = Reference(), parameters
    for index, command in enumerate(commands):
        event: dict[str, Any] = {}
        if index in changes:
            event["parameters"] = _difference(in_force, changes[index])
            in_force = changes[index]
        if command.reference != reference:
            reference = command.reference
            event["reference"] = {"vx": reference.vx, "vy": reference.vy, "yaw_rate": reference.yaw_rate}
        if command.push is not None:
            event["push"] = _push(command.push)
        if index in solves_in_time:
            event["solves_in_time"] = solves_in_time[index]
        if event:
            events.append({"t": index * parameters.control_period} | event)
    return {
        "name": name,
        "robot": robot.source,
        "duration": len(commands) * parameters.control_period,
        "parameters": _difference(robot.parameters, parameters),
        **({} if world == PERFECT else {"world": world.to_mapping()}),
        "initial_state": state.to_mapping(),
        "events": events,
    }


def _difference(before: Parameters, after: Parameters) -> dict[str, Any]:
    """The parameters that have another value after a change."""
    old = before.to_mapping()
    return {name: value for name, value in after.to_mapping().items() if value != old[name]}


def _push(push: Push) -> dict[str, Any]:
    place = ({"link": push.link} if push.link else {}) | ({} if push.point is None else {"point": push.point.tolist()})
    return {"impulse": push.impulse.tolist(), "duration": push.duration, "frame": push.frame} | place
