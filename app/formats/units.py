"""Units of the columns of a recording, for formats that carry them."""

import re

# The first pattern that a name matches tells its unit.
UNITS = (
    (r"(tick|phase|support_side|samples_on_support|steps_to_stand|status)", ""),
    (r"q_[3-6]", ""),
    (r"q_[0-2]", "m"),
    (r"q_\d+", "rad"),
    (r"(t|time_to_touchdown)", "s"),
    (r"push_[xy]", "N s"),
    (r"reference_yaw_rate", "rad/s"),
    (r"(com|reference)_v[xy]", "m/s"),
    (r"com_a[xy]", "m/s^2"),
    (r"jerk_[xy]", "m/s^3"),
    (r".*_yaw", "rad"),
    (r".*_[xyz]", "m"),
)
COUNTS = frozenset({"tick", "phase", "support_side", "samples_on_support", "steps_to_stand", "status"})
"""Columns of whole numbers."""


def unit(column: str) -> str:
    """Of a column; empty for counts, codes and quaternions."""
    return next(unit for pattern, unit in UNITS if re.fullmatch(pattern, column))
