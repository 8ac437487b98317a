"""Every scenario that ships keeps its expectations: quickly as a point mass on the paper's ticks, and as it ships."""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from app.formats import FORMATS
from walkcore import load_scenario, record, scenario_names
from walkcore.scenario.expectations import METRICS
from walkcore.scenario.scenario import scenario_from_mapping

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
@pytest.mark.timeout(1800)
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


def test_the_documentation_names_all_that_there_is():
    text = (Path(__file__).parent.parent / "docs" / "scenarios.md").read_text(encoding="utf-8")
    for name in (*scenario_names(), *METRICS, *FORMATS):
        assert f"`{name}`" in text, name
    example = text.split("```yaml\n")[1].split("```")[0]
    assert len(scenario_from_mapping(yaml.safe_load(example)).expectations) == 3
