"""Truth of the plan: previews come to be, and every sample stands within its stance."""

from typing import Any

import numpy as np
import pytest

from walkcore import Command, Parameters, Reference, Simulation, load_robot
from walkcore.mpc.plan import Status
from walkcore.mpc.regions import half_planes

PAPER = Parameters(control_period=0.1)  # ticks are samples: a plan's first sample is the next snapshot
WALK = [(1.0, Reference()), (4.0, Reference(vx=0.25, vy=0.1)), (3.0, Reference(yaw_rate=0.3)), (4.0, Reference())]


@pytest.fixture(scope="module")
def walk() -> list[Any]:
    simulation = Simulation(load_robot("hrp2"), PAPER)
    return [simulation.step(Command(reference)) for seconds, reference in WALK for _ in range(round(10 * seconds))]


def test_previews_are_what_comes_to_be(walk):
    nb_compared = 0
    for before, after in zip(walk[15:40], walk[16:], strict=False):
        if before.plan.status is Status.SOLVED and not np.any(after.push):
            nb_compared += 1
            assert before.plan.dcm[0] == pytest.approx(after.dcm, abs=1e-9)
            assert before.plan.com[0] == pytest.approx(after.com.position, abs=1e-9)
    assert nb_compared > 20


def test_every_sample_stands_within_its_stance(walk):
    nb_single = nb_double = 0
    for snapshot in walk:
        plan = snapshot.plan
        assert len(plan.stance_of_sample) == len(plan.cop)
        if plan.status is not Status.SOLVED:
            continue
        for number, cop in zip(plan.stance_of_sample, plan.cop, strict=True):
            stance = plan.stances[number]
            assert half_planes(stance.polygon).excess(cop) < 1e-4 - PAPER.cop_margin
            nb_single += not stance.is_double_support
            nb_double += stance.is_double_support
    assert nb_single > 500 and nb_double > 100


def test_every_sample_has_a_stance_while_the_steps_become_shorter():
    simulation = Simulation(load_robot("hrp2"))
    for tick in range(900):
        if tick == 620:  # in the middle of a step, which keeps its duration
            simulation.change(simulation.parameters.changed({"step_duration": 0.4}))
        plan = simulation.step(Command(Reference(vx=0.1))).plan
        assert plan is not None
        assert len(plan.stance_of_sample) == len(plan.times)
        assert np.all((plan.stance_of_sample >= 0) & (plan.stance_of_sample < len(plan.stances)))
