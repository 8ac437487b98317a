"""Text of a robot file, with the unit of each quantity beside it."""

from collections.abc import Mapping
from typing import Any

import yaml

FOOT_SPEED = "m/s, along x and y of the support foot's frame, for (30): "
FOOT_YAW_RATE = "rad/s: "
UNITS = {
    "mass": "kg, of the URDF",
    "com_height": "m, over the ground: lower it where the knees stretch",
    "stance_width": "m, between the sole frames at rest",
    "sole": "m, outline of the left sole in its own frame; the right one is its mirror image",
    "foothold_regions": "m, of the left foot in the right foot's frame: a guess from the size, see walk footholds",
    "max_foot_speed": f"{FOOT_SPEED}a guess from the robot's size, as a joint of the legs has no speed limit",
    "max_foot_yaw_rate": f"{FOOT_YAW_RATE}a guess",
    "max_com_distance": "m, horizontal, from the support foot: beyond, the leg is too short and the robot has fallen",
    "max_reference": "m/s, rad/s: a guess from the robot's size",
    "max_push": "N s",
    "tipping_margin": "m, that the CoP commanded in physics keeps from the edges of the soles",
    "swing_moments": "s^2, fitted on walks in the ideal model",
    "gait": "s, m",
    "body": "frames and files; angles in rad",
}


STUDIED = {
    "foothold_regions": "m, of the left foot in the right foot's frame: found by walk footholds",
    "max_reference": "m/s, rad/s: the fastest within the joints' limits, none beyond the guess from the size",
}
"""The same for values that simulations have found."""


def robot_text(values: Mapping[str, Any], urdf: str, found: Mapping[str, str] | None = None) -> str:
    """YAML of a robot file.

    Args:
        values: of the file.
        urdf: name of the URDF that they come from.
        found: unit and origin of values that were found, instead of guessed, by their keys.
    """
    lines = [f"# Measured on {urdf} by walk import; what each number means stands in docs/robots.md."]
    units = UNITS | dict(found or {})
    for key, value in values.items():
        if key in units:
            lines.append(f"# {units[key]}")
        is_plain = not isinstance(value, dict | list)  # PyYAML would put a mapping of it into braces
        style = False if is_plain else None
        lines.append(yaml.safe_dump({key: value}, sort_keys=False, default_flow_style=style, width=150).rstrip())
    return "\n".join(lines) + "\n"
