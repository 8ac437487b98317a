"""Every scenario that ships keeps its expectations: here as a point mass on coarser ticks, `walk run` tells all."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import pytest

from walkcore import load_scenario, record, scenario_names

COARSE = 0.05  # [s]
OF_THE_BODY = ("cop_error", "com_error", "sole_error", "torque_use", "speed_use")


def broken(name):
    """Expectations that do not hold; those of the body are left out."""
    shipped = load_scenario(name).without_body()
    events = tuple(
        event if event.parameters is None else replace(event, parameters=replace(event.parameters, **PERIOD))
        for event in shipped.events
    )
    scenario = replace(shipped, parameters=replace(shipped.parameters, **PERIOD), events=events)
    verdicts = record(scenario).verdicts()
    assert verdicts
    return [v for v in verdicts if not v.holds and not v.name[4:].startswith(OF_THE_BODY)]


PERIOD = {"control_period": COARSE}


@pytest.fixture(scope="module")
def found():
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        return dict(zip(scenario_names(), pool.map(broken, scenario_names()), strict=True))


@pytest.mark.parametrize("name", scenario_names())
def test_a_shipped_scenario_keeps_its_expectations(found, name):
    assert found[name] == []


def test_there_are_a_dozen_each_with_a_description():
    scenarios = [load_scenario(name) for name in scenario_names()]
    assert len(scenarios) >= 12
    assert all(20 < len(scenario.description) < 140 and scenario.expectations for scenario in scenarios)
