"""Online walking motion generation with automatic foot step placement (Herdt et al. 2010)."""

from walkcore.command import Command, Push, Reference
from walkcore.errors import WalkError
from walkcore.parameters import Parameters
from walkcore.robot import Robot
from walkcore.robot_file import load_robot, robot_names
from walkcore.scenario.recording import Recording, record
from walkcore.scenario.scenario import Scenario, load_scenario, scenario_names
from walkcore.simulation import Simulation
from walkcore.snapshot import Snapshot

__all__ = [
    "Command",
    "Parameters",
    "Push",
    "Recording",
    "Reference",
    "Robot",
    "Scenario",
    "Simulation",
    "Snapshot",
    "WalkError",
    "load_robot",
    "load_scenario",
    "record",
    "robot_names",
    "scenario_names",
]
