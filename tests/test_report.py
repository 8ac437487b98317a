"""Reports of a run whose name and description come from outside."""

import re

import pytest

from app.formats import read_run, write_run
from app.report import comparison_rows, write_comparison, write_report
from walkcore.scenario.recording import record
from walkcore.scenario.scenario import scenario_from_mapping

HOSTILE = (
    "<img src=x onerror=alert(1)> [click](javascript:alert(1)) `code` | cell\n\n# heading & <script>alert(2)</script>"
)


def test_names_and_descriptions_are_text_in_markdown_and_html(tmp_path):
    scenario = {"name": HOSTILE, "description": HOSTILE, "robot": "hrp2", "duration": 1.0}
    write_run(record(scenario_from_mapping(scenario)), tmp_path / "run", ("npz",))
    for page in write_report(read_run(tmp_path / "run"), tmp_path / "report"):
        text = page.read_text(encoding="utf-8")
        assert "alert(1)" in text
        assert not re.search("<img|<script", text), page.name
        if page.suffix == ".md":
            assert "](javascript" not in text and "# heading" not in re.findall("^#.*$", text, re.MULTILINE)


def test_a_robot_in_physics_and_its_twin_stand_side_by_side_in_report_and_comparison(tmp_path):
    pytest.importorskip("mujoco", reason="mujoco-core is not installed on this platform")
    physics = {"plant": "mujoco", "twin": True, "initial_double_support_duration": 0.2}
    events = [{"t": 0.0, "reference": {"vx": 0.3}}, {"t": 0.9, "push": {"impulse": [0.0, -60.0]}}]
    scenarios = [{"name": "shoved", "duration": 1.9, "parameters": physics, "events": events[:n]} for n in (2, 1)]
    runs = []
    for number, scenario in enumerate(scenarios):
        write_run(record(scenario_from_mapping(scenario)), tmp_path / str(number), ("npz",))
        runs.append(read_run(tmp_path / str(number)))
    shoved, both_up = runs
    markdown, page = write_report(shoved, tmp_path / "report")
    rows = [line.strip("| ").split(" | ") for line in markdown.read_text().splitlines() if line.startswith("|")]
    fallen = next(row for row in rows if row[0] == "fallen" and len(row) == 3)
    assert fallen[1].startswith("after ") and "fell" in shoved.metrics["twin_difference"]
    for text in (markdown.read_text(), page.read_text()):
        told = shoved.metrics["twin_difference"]
        assert f"{told[:1].upper()}{told[1:]}." in text and "Robot and ideal twin" in text
    assert (tmp_path / "report" / "pair.svg").exists()
    told = next(row for row in comparison_rows(runs, ["one", "other"]) if row[0] == "ideal twin")
    assert told[1:] == [run.metrics["twin_difference"] for run in runs] and told[2].startswith("both are up")
    write_comparison(runs, ["one", "other"], tmp_path / "compared")
