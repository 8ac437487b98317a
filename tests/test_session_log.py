"""The last minute of the live walk, kept and saved."""

import json

import numpy as np
import pytest
from test_fork import JumpingClock, recording

from app.live import session_log
from app.live.control import Control, NothingToSaveError
from app.live.live_state import ReferenceCommand
from app.live.session_log import Session, SessionLog
from walkcore import Command, Parameters, Push, Reference, Simulation, load_robot
from walkcore.scenario.recording import record
from walkcore.scenario.scenario import scenario_from_mapping
from walkcore.simulation import NOT_IN_TIME
from walkcore.stages import time_of_solves

LIVE = Parameters(initial_double_support_duration=0.3, dynamic_filter=True)


def drive(control: Control, nb_ticks: int, seed: int) -> None:
    """References, pushes and changed parameters at random."""
    rng = np.random.default_rng(seed)
    for _ in range(nb_ticks):
        if rng.random() < 0.02:
            reference = Reference(rng.uniform(-0.1, 0.3), rng.uniform(-0.1, 0.1), rng.uniform(-0.2, 0.2))
            control.set_reference(ReferenceCommand(reference, "joystick"))
        if rng.random() < 0.02:
            control.push(Push(rng.uniform(-4.0, 4.0, 2), rng.uniform(0.0, 0.1)))
        if rng.random() < 0.04:
            values = {"alpha": float(10 ** rng.uniform(-6, -4)), "step_duration": float(rng.choice([0.6, 0.8, 1.0]))}
            control.change(values)
        control.tick()
        control.tidy()


@pytest.mark.parametrize(("name", "nb_ticks"), [("talos", 150), ("talos", 330), ("hrp2", 330)])
def test_what_was_driven_replays_to_the_same_bytes(monkeypatch, name, nb_ticks):
    monkeypatch.setattr(session_log, "KEPT", 1.0)  # so that the longer ones have lost their beginning
    robot = load_robot(name)
    control = Control(robot, LIVE, lambda _: None)
    control.start()
    drive(control, nb_ticks, seed=1)
    driven = recording(control, robot)
    nb_kept = len(driven.rows)
    assert driven["tick"][-1] == nb_ticks and nb_kept == min(
        nb_ticks + 1, 200 + 1 + nb_ticks % session_log.TICKS_PER_SEGMENT
    )
    assert driven.parameter_changes and np.any(driven["push_x"] != 0.0)
    scenario = scenario_from_mapping(json.loads(json.dumps(driven.scenario.source, allow_nan=False)))
    replayed = record(scenario)
    assert replayed.rows.tobytes() == driven.rows.tobytes()
    assert replayed.run_json() == driven.run_json()


@pytest.mark.parametrize("changed", [{}, {"solver": "daqp"}, {"step_timing": "adaptive"}], ids=str)
def test_ticks_that_ran_out_of_time_are_replayed_as_they_were(changed):
    hrp2, parameters = load_robot("hrp2"), LIVE.changed({"dynamic_filter": False, "control_period": 0.02} | changed)
    control = Control(hrp2, parameters, lambda _: None, JumpingClock())
    control.start()
    reasons = set[str]()
    for tick in range(300):
        if tick % 50 == 0:
            control.set_reference(ReferenceCommand(Reference(vx=0.1 + 5e-4 * tick), "rest"))
        if tick % 80 == 70:
            control.push(Push([2.0, 3.0]))
        control.tick()
        reasons.add(control.latest.snapshot.reason)
    driven = recording(control, hrp2)
    source = json.loads(json.dumps(driven.scenario.source))
    assert NOT_IN_TIME in reasons and sum("solves_in_time" in event for event in source["events"]) > 5
    assert record(scenario_from_mapping(source)).rows.tobytes() == driven.rows.tobytes()


def test_a_session_does_not_begin_with_a_tick_that_ran_out_of_time():
    """It would go on with the plan of the tick before, which is not in its state."""
    simulation = Simulation(load_robot("hrp2"), Parameters(control_period=0.02))
    log = SessionLog(simulation)
    for tick in range(40):
        solves = {0: 0, 10: 1, 15: 0}.get(tick)
        log.begin()
        log.end(Command(), simulation.step(Command(), time_of_solves(solves)), solves)
    session = Session.unpacked(log.last_minute())
    assert session.segments[0].ticks[0].snapshot.tick == 20
    source = session.recording("driven", simulation.robot).scenario.source
    assert not any("solves_in_time" in event for event in source["events"])


def test_the_outcome_of_a_push_on_the_page_is_that_in_the_metrics_of_the_saved_walk():
    control = Control(load_robot("hrp2"), Parameters(control_period=0.02), lambda _: None)
    control.start()
    control.set_reference(ReferenceCommand(Reference(vx=0.2), "rest"))
    shown = {}
    for tick in range(700):
        if tick in (300, 500):
            control.push(Push([0.0, 5.0], 0.1))
        control.tick()
        if (push := control.latest.last_push) is not None:
            shown[push.t] = (push.impulse, push.time, push.steps)
    driven = recording(control, load_robot("hrp2"))
    measured = {p["t"]: (p["impulse"], p["time"], p["steps"]) for p in driven.metrics()["pushes"]}
    assert measured == shown and all(steps > 0 for _, _, steps in shown.values())


def test_changes_where_one_segment_ends_and_the_next_begins_are_in_the_scenario():
    control = Control(load_robot("hrp2"), Parameters(), lambda _: None)
    control.set_reference(ReferenceCommand(Reference(vx=0.2), "rest"))
    for i in range(5):
        control.pause()
        control.step(session_log.TICKS_PER_SEGMENT - (i == 0))
        control.change({"alpha": 1e-5 * (i + 1)})
        control.change({"beta": 1.0 + i})
    control.step(1)
    driven = recording(control, load_robot("hrp2"))
    found = [(change["tick"], change["parameters"]["alpha"]) for change in driven.parameter_changes]
    assert found == [(session_log.TICKS_PER_SEGMENT * (i + 1), 1e-5 * (i + 1)) for i in range(5)]
    assert record(driven.scenario).rows.tobytes() == driven.rows.tobytes()


@pytest.mark.parametrize("period", [0.005, 0.02, 0.1])
def test_a_minute_is_kept_whatever_the_period(period):
    simulation = Simulation(load_robot("hrp2"), Parameters(control_period=period))
    snapshot, log = simulation.step(), SessionLog(simulation)
    for _ in range(round(70.0 / period)):
        log.begin()
        log.end(Command(), snapshot)
        log.pack()
    kept = sum(len(segment.ticks) for segment in Session.unpacked(log.last_minute()).segments) * period
    assert 60.0 <= kept - session_log.TICKS_PER_SEGMENT * period < 62.0  # but for the segment that still grows


def test_the_walk_before_a_reset_can_still_be_saved_and_what_is_saved_grows_no_more():
    control = Control(load_robot("hrp2"), Parameters(), lambda _: None)
    with pytest.raises(NothingToSaveError):
        control.save(True)
    control.pause()
    control.step(10)
    kept = list(control.save(False))
    control.step(5)
    control.reset()
    control.step(3)
    lengths = [
        sum(len(segment.ticks) for segment in Session.unpacked(list(found)).segments)
        for found in (kept, control.save(True), control.save(False))
    ]
    assert lengths == [11, 16, 4]
