"""The robot and the ideal one beside it: what became of the same commands in physics and in the model, in words."""

import numpy as np

from walkcore.analysis.columns import Walk, has_column, nb_rows_up, points, touchdowns
from walkcore.mpc.plan import Status


def twin_difference(walk: Walk) -> str:
    """One sentence on the difference between a walk in physics and its ideal twin.

    Args:
        walk: with the columns of a plant and of a twin; without them the sentence is empty.
    """
    if not has_column(walk, "twin_status"):
        return ""
    fallen_twin = np.flatnonzero(walk["twin_status"] == Status.FALLEN)
    end, end_of_twin = nb_rows_up(walk), int(fallen_twin[0]) if len(fallen_twin) else len(walk["status"])
    foot = f"its {_last_footstep(walk, min(end, end_of_twin))}"
    match end < len(walk["status"]), end_of_twin < len(walk["status"]):
        case True, False:
            return f"the model went on; the robot fell, {foot}"
        case False, True:
            return "the model lost its balance; the robot went on"
        case True, True:
            seconds = (end - end_of_twin) * float(walk.parameters["control_period"])
            which = "later" if seconds >= 0 else "earlier"
            return f"both fell, the robot {abs(seconds):.1f} s {which} than the model"
        case _:
            distance = np.hypot(*(points(walk, "measured_com") - points(walk, "twin_com"))[-1])
            return f"both are up, {100 * distance:.0f} cm from each other at the end"


def _last_footstep(walk: Walk, end: int) -> str:
    """How far the last footstep before a row lies from that of the twin, relative to the foot that stood."""
    landed = touchdowns(walk)
    landed = landed[landed < end]
    if not len(landed):
        return "feet where the model's were"
    k = int(landed[-1])
    moved = "left" if walk["left_z"][k - 1] > 0.0 else "right"
    stood = "right" if moved == "left" else "left"
    step = [
        (points(walk, f"{prefix}{moved}") - points(walk, f"{prefix}{stood}"))[k] for prefix in ("measured_", "twin_")
    ]
    short = float(np.hypot(*step[1]) - np.hypot(*step[0]))
    return f"last step {100 * abs(short):.0f} cm {'shorter' if short > 0 else 'longer'} than the model's"
