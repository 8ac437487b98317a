"""Pushes in the scene: the last one, the preview of one that is aimed, and steps that are shortened to catch it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scene_reader import latest
from test_scene import FRAME, FRAME_TIME, REFERENCE, draw

from app.viewer.scene.frame import Aim
from app.viewer.scene.proportions import Proportions
from app.viewer.scene.pushes import SECONDS_SHOWN, arrow_away, effect_of_push
from app.viewer.scene.scene import WORLD
from walkcore import Command, Parameters, Push, Simulation, load_robot
from walkcore.mpc.gait import Phase
from walkcore.mpc.plan import Status


def test_last_push_is_drawn_for_a_moment_and_an_older_one_never(scene):
    simulation = Simulation(load_robot("hrp2"), Parameters())
    arrow, push = f"{WORLD}/push/at_com/last", Push([-3.0, 7.0], 0.03, "world")

    def steps(nb_ticks: int, push: Push | None = None) -> Any:
        simulation.step(Command(REFERENCE, push))
        return [simulation.step(Command(REFERENCE)) for _ in range(nb_ticks)][-1]

    steps(1003)
    steps(100, push)
    for _ in range(20):
        draw(scene, steps(FRAME))
        assert latest(scene.updates, "visible")[arrow] is False  # given before the first frame
    pushed = steps(FRAME, push)
    draw(scene, pushed)
    expected = arrow_away(-push.impulse, 1.35 * pushed.com_height, Proportions.of(simulation.robot))[:, ::-1]
    assert latest(scene.updates, "points")[arrow] == pytest.approx(expected)
    for _ in range(round(SECONDS_SHOWN / FRAME_TIME) - 1):
        assert latest(scene.updates, "visible")[arrow] is True
        draw(scene, pushed)
    draw(scene, pushed, pushed)
    assert latest(scene.updates, "visible")[arrow] is False
    draw(scene, steps(200, push))  # at four times the speed of time, on a machine that draws four frames a second
    assert latest(scene.updates, "visible")[arrow] is True


@pytest.mark.parametrize(
    ("impulse", "effect"),
    [([0.0, 10.0], "stands"), ([15.0, 0.0], "steps"), ([25.0, 0.0], "fall")],
    ids=["light", "harder", "hopeless"],
)
def test_preview_of_a_push_on_a_standing_robot_shows_its_effect(scene, impulse, effect):
    robot = load_robot("hrp2")
    simulation = Simulation(robot, Parameters())
    now, command = simulation.step(), Command(push=Push(impulse))
    after = simulation.preview(command)
    draw(scene, now, aim=Aim(np.array(impulse), after))
    assert latest(scene.updates, "text")[f"{WORLD}/push/preview/at_com/label"].endswith(effect)
    visible = latest(scene.updates, "visible")
    assert any(visible[name] for name in visible if "/steps/" in name) is bool(after.plan.footholds)
    dcm = latest(scene.updates, "position")[f"{WORLD}/push/preview/dcm"][:2]
    jump = np.array(impulse) / robot.mass / now.pendulum.omega
    assert dcm == pytest.approx(now.com.position + jump, abs=1e-4)

    came = [simulation.step(command), *(simulation.step() for _ in range(400))]
    assert (effect == "fall") is (came[-1].status is Status.FALLEN)
    assert (effect == "stands") is all(snapshot.phase is Phase.STANDING for snapshot in came)


@pytest.fixture(scope="module")
def hurried():
    """Snapshots of a robot that stands and catches a push by shortened steps, and its parameters."""
    parameters = Parameters(step_timing="adaptive", control_period=0.02)
    simulation = Simulation(load_robot("hrp2"), parameters)
    simulation.step()
    return [simulation.step(Command(push=Push([20.0, 0.0]))), *(simulation.step() for _ in range(300))], parameters


def test_a_ring_around_the_foothold_shrinks_until_the_touchdown(scene, hurried):
    snapshots, parameters = hurried
    radii, ring = {True: [], False: []}, f"{WORLD}/plan/ring"
    for snapshot in snapshots:
        for _ in range(3):  # lines are sent in one frame of three
            scene.draw(snapshot, parameters, FRAME_TIME)
        visible = latest(scene.updates, "visible")
        assert visible[ring] is (snapshot.phase is Phase.SINGLE_SUPPORT)
        if visible[ring]:
            is_shortened = snapshot.step_duration < 0.79
            name = f"{ring}/shortened" if is_shortened else f"{ring}/usual"
            assert visible[name] and not visible[f"{ring}/usual" if is_shortened else f"{ring}/shortened"]
            radius = np.hypot(*latest(scene.updates, "points")[name][0, 0, :2])
            radii[is_shortened].append((snapshot.time_to_touchdown, radius))
            at = latest(scene.updates, "position")[ring][:2]
            assert at == pytest.approx(snapshot.plan.footholds[0].position, abs=1e-3)
    for found in radii.values():
        times, sizes = np.array(sorted(found)).T
        assert len(times) > 5 and np.all(np.diff(sizes)[np.diff(times) > 1e-6] > 0.0)


def test_the_prints_of_shortened_steps_are_outlined_and_no_others(scene, hurried):
    snapshots, parameters = hurried
    landings = [
        (after.feet[before.support.side.other].position, before.step_duration < 0.79)
        for before, after in zip(snapshots, snapshots[1:], strict=False)
        if before.phase is Phase.SINGLE_SUPPORT and after.phase is not Phase.SINGLE_SUPPORT
    ]
    for snapshot in snapshots:
        scene.draw(snapshot, parameters, FRAME_TIME)
    visible, at = latest(scene.updates, "visible"), latest(scene.updates, "position")
    marks = [name for name in visible if name.endswith("/shortened") and "/footprints/" in name]
    marked = [at[name.removesuffix("/shortened")][:2] for name in marks if visible[name]]
    assert 0 < len(marked) == sum(is_shortened for _, is_shortened in landings) < len(landings)
    for position, is_shortened in landings:
        assert is_shortened is any(np.allclose(position, place, atol=1e-3) for place in marked)


def test_the_preview_of_a_push_foretells_shortened_steps(hurried):
    snapshots, parameters = hurried
    robot = load_robot("hrp2")
    assert effect_of_push(robot, snapshots[0], parameters).startswith("shortens steps to 0.")
    assert effect_of_push(robot, snapshots[0], replace(parameters, step_duration=0.4)) == "at its limit"


def test_the_preview_of_a_push_says_that_a_law_without_a_qp_may_catch_what_it_does_not_foresee(hurried):
    snapshots, parameters = hurried
    lost = replace(snapshots[0], plan=replace(snapshots[0].plan, is_capturable=False))
    assert effect_of_push(load_robot("hrp2"), lost, parameters) == "would fall"
    assert effect_of_push(load_robot("hrp2"), lost, replace(parameters, scheme="sugihara")) == "may fall"
