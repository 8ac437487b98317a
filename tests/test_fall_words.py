"""A fall of the ideal model is told by the push, by the step that it needed, and by the region of the feet."""

import re

import numpy as np
import pytest

from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.mpc.plan import Status
from walkcore.mpc.stance import Footstep, Side
from walkcore.plant.fall_watch import FallSigns, needed_step

REGION = np.array([[-0.3, 0.15], [0.4, 0.15], [0.4, 0.45], [-0.3, 0.45]])
RIGHT = Footstep(Side.RIGHT, np.array([1.0, 2.0]), np.pi / 2)
SOLE = np.array([[-0.1, -0.06], [0.1, -0.06], [0.1, 0.06], [-0.1, 0.06]])


@pytest.mark.parametrize(
    ("dcm", "words"),
    [
        ((0.1, 0.58), "the step needed was 0.52 m to the left, the region ends at 0.45 m"),
        ((0.72, 0.3), "the step needed was 0.62 m forward, the region ends at 0.40 m"),
        ((0.0, 0.07), "the step needed was 0.13 m to the left, the region begins at 0.15 m"),
        ((0.0, -0.2), "the step needed was 0.14 m to the right, across the other leg"),
    ],
)
def test_step_that_is_out_of_reach_is_told_with_the_end_of_the_region(dcm, words):
    step = needed_step(RIGHT, np.array(dcm), REGION, SOLE)
    assert step is not None and step.in_words() == words
    assert step.foothold.side is Side.LEFT
    assert step.foothold.position == pytest.approx([1.0 - step.place[1], 2.0 + step.place[0]])


def test_step_within_reach_of_the_sole_is_none():
    assert needed_step(RIGHT, np.array([0.48, 0.5]), REGION, SOLE) is None


def test_step_is_that_of_the_moment_when_the_capturable_set_was_left():
    first, later = (needed_step(RIGHT, np.array([0.0, y]), REGION, SOLE) for y in (0.6, 0.9))
    signs = FallSigns().seen(["not_capturable"], 10, 0.005, first).seen(["not_capturable"], 11, 0.005, later)
    assert signs.step == first
    assert signs.seen([], 1000, 0.005).step is None  # it was caught all the same


@pytest.mark.parametrize(("impulse", "way"), [((0.0, 60.0), "to the left"), ((60.0, 0.0), "forward")])
def test_fall_of_the_ideal_model_is_told_by_its_push_and_not_by_its_joints(impulse, way):
    simulation = Simulation(load_robot("talos"), Parameters())
    for tick in range(600):
        push = Push(np.array(impulse)) if tick == 100 else None
        snapshot = simulation.step(Command(Reference(), push))
        if snapshot.status is Status.FALLEN:
            break
    assert snapshot.reason.startswith(f"60 N s {way} while it stood: the robot fell 0.")
    assert snapshot.needed_step is not None and snapshot.needed_step.in_words() in snapshot.reason
    assert re.search(rf"the step needed was \d\.\d\d m {way}", snapshot.reason)
    assert "target" not in snapshot.reason
