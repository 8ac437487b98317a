import json
import os
import shutil
import signal
import subprocess

import numpy as np
import pytest
from conftest import WALK, walk

SHORT = """
name: short
description: a short walk
robot: {robot}
duration: 2.0
parameters: {{control_period: 0.1}}
events: [{{t: 0.3, reference: {{vx: 0.1}}}}]
expect: {{not_fallen: true, max_final_speed: {bound}}}
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Three scenarios at once, of which one breaks a promise; and what was said."""
    folder = tmp_path_factory.mktemp("runs")
    for name, robot, bound in (("kept", "hrp2", 9), ("broken", "hrp2", 0.0), ("body", "talos", 9)):
        (folder / f"{name}.yaml").write_text(SHORT.format(robot=robot, bound=bound))
    said = walk("run", *sorted(folder.glob("*.yaml")), "--out", folder, "--jobs", "2", "--format", "npz", "parquet")
    return folder, said


def test_several_scenarios_get_a_folder_each_and_a_broken_expectation_is_exit_code_one(runs):
    folder, said = runs
    assert said.returncode == 1, said.stderr
    assert "BROKEN: max_final_speed = 0.0, measured" in said.stdout
    for name in ("kept", "broken", "body"):
        assert sorted(path.name for path in (folder / name).iterdir()) == [
            "recording.npz",
            "recording.parquet",
            "run.json",
        ]
    (first, second) = json.loads((folder / "broken" / "run.json").read_text())["expectations"]
    assert first == {"name": "not_fallen", "bound": True, "measured": True, "holds": True}
    assert second["holds"] is False and second["bound"] == 0.0


def test_one_scenario_goes_straight_into_the_folder_with_the_same_bytes(runs, tmp_path):
    folder, _ = runs
    said = walk("run", folder / "kept.yaml", "--out", tmp_path)
    assert (said.returncode, said.stderr) == (0, "")
    assert "2 of 2 expectations hold" in said.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["recording.csv", "recording.npz", "run.json"]
    for name in ("recording.npz", "run.json"):
        assert (tmp_path / name).read_bytes() == (folder / "kept" / name).read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "moonwalk", "--out", "x"], "no scenario 'moonwalk'; there are: circle"),
        (["run", "circle", "circle", "--out", "x"], "circle"),
        (["run", "--out", "x"], "name at least one"),
        (["report", "nowhere"], "must be a folder with run.json"),
        (["compare", "nowhere"], "name at least two"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_two(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = walk(*arguments)
    assert said.returncode == 2
    assert message in said.stderr and len(said.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_reader_that_has_read_enough_ends_the_command_without_a_word():
    read_end, write_end = os.pipe()
    os.close(read_end)
    said = subprocess.run([WALK, "robots"], stdout=write_end, stderr=subprocess.PIPE, text=True)
    os.close(write_end)
    assert (said.returncode, said.stderr) == (128 + signal.SIGPIPE, "")


def test_a_report_is_a_page_that_needs_nothing_else(runs, tmp_path):
    folder, _ = runs
    assert walk("report", folder / "body", "--out", tmp_path).returncode == 0
    page = (tmp_path / "report.html").read_text()
    assert page.count("<svg") == 6 and "src=" not in page
    assert "a short walk" in page and "leg_left_4_joint" in page and "max_final_speed" in page
    markdown = (tmp_path / "report.md").read_text()
    for line in markdown.splitlines():
        if line.startswith("!["):
            assert (tmp_path / line[line.index("(") + 1 : -1]).exists()


def test_a_report_says_what_is_broken(runs, tmp_path):
    folder, _ = runs
    assert walk("report", folder / "broken", "--out", tmp_path).returncode == 0
    assert '<td class="broken">BROKEN</td>' in (tmp_path / "report.html").read_text()


def test_runs_are_compared_side_by_side(runs, tmp_path):
    folder, _ = runs
    said = walk("compare", folder / "kept", folder / "body", "--out", tmp_path)
    assert said.returncode == 0, said.stderr
    head, robots, *_ = said.stdout.splitlines()
    assert head.split() == ["kept", "body"] and robots.split() == ["robot", "hrp2", "talos"]
    page = (tmp_path / "comparison.html").read_text()
    assert page.count("<svg") == 6 and "Parameters that differ" in page


def with_key(key, value):
    """A change of run.json: another value behind a key, given as "outer.inner"."""

    def change(text):
        run = json.loads(text)
        inner = run
        *outer, last = key.split(".")
        for part in outer:
            inner = inner[part]
        inner[last] = value
        return json.dumps(run)

    return change


@pytest.mark.parametrize(
    "change",
    [
        lambda _: "{}",
        lambda _: "[" * 100_000,
        lambda text: text[:-100],
        lambda text: text.replace('"ticks": 20', '"ticks": 1' + "0" * 5000),
        *(with_key(key, value) for key in ("scenario", "metrics", "parameters", "versions") for value in (3, [], "x")),
        with_key("parameters", {}),
        with_key("parameters.sole", 3),
        with_key("metrics", {}),
        with_key("expectations", 3),
    ],
)
def test_a_run_that_is_not_as_written_is_refused_in_one_line(runs, tmp_path, change):
    folder, _ = runs
    shutil.copytree(folder / "kept", tmp_path / "run")
    file = tmp_path / "run" / "run.json"
    file.write_text(change(file.read_text()))
    said = walk("report", tmp_path / "run", "--out", tmp_path / "out")
    assert said.returncode == 2 and said.stderr.startswith("walk: run = ") and len(said.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    "columns",
    [{}, {"t": np.zeros(3)}, {"t": np.zeros((20, 2))}, {"t": np.array(["a"] * 20)}, {"t": np.array([{}] * 20)}],
    ids=["none", "short", "a matrix", "text", "objects"],
)
def test_a_recording_that_is_not_as_written_is_refused_in_one_line(runs, tmp_path, columns):
    folder, _ = runs
    shutil.copytree(folder / "kept", tmp_path / "run")
    with np.load(tmp_path / "run" / "recording.npz") as file:
        good = {name: file[name] for name in file.files}
    np.savez(tmp_path / "run" / "recording.npz", **(good | columns if columns else {}))
    said = walk("compare", tmp_path / "run", folder / "kept")
    assert said.returncode == 2 and said.stderr.startswith("walk: run = ") and len(said.stderr.splitlines()) == 1
    (tmp_path / "run" / "recording.npz").write_text("nothing")
    assert "cannot be read" in walk("report", tmp_path / "run").stderr


def test_scenarios_are_listed_with_what_they_are_and_their_schema():
    listed = walk("scenarios").stdout
    assert "circle" in listed and "A whole circle to the left" in listed
    assert json.loads(walk("scenarios", "--schema").stdout)["title"] == "Scenario"
