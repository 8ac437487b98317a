"""Every scenario that ships keeps its expectations: quickly as a point mass on the paper's ticks, and as it ships."""

from dataclasses import replace

import pytest

from walkcore import load_scenario, record, scenario_names

COARSE = {"control_period": 0.1}  # [s]
OF_THE_BODY = ("cop_error", "com_error", "sole_error", "torque_use", "speed_use")


def coarse(scenario):
    """The same with fewer ticks, and without the body."""
    events = tuple(
        event if event.parameters is None else replace(event, parameters=replace(event.parameters, **COARSE))
        for event in scenario.events
    )
    return replace(scenario.without_body(), parameters=replace(scenario.parameters, **COARSE), events=events)


@pytest.mark.parametrize("name", scenario_names())
def test_a_shipped_scenario_keeps_its_expectations_as_a_point_mass(name):
    verdicts = record(coarse(load_scenario(name))).verdicts()
    assert [v for v in verdicts if not v.holds and not v.name[4:].startswith(OF_THE_BODY)] == []


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", scenario_names())
def test_a_shipped_scenario_keeps_its_expectations(name):
    scenario = load_scenario(name)
    verdicts = record(scenario).verdicts()
    assert len(verdicts) == len(scenario.expectations)
    assert [v for v in verdicts if not v.holds] == []


def test_there_are_a_dozen_each_with_a_description():
    scenarios = [load_scenario(name) for name in scenario_names()]
    assert len(scenarios) >= 12
    assert all(20 < len(scenario.description) < 140 and scenario.expectations for scenario in scenarios)
