"""Lessons: their experiments prove the answers that they explain, a file adds one, and the page runs them."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from conftest import Server, ended, serving, wait_for, walk
from playwright.sync_api import expect

from walkcore import record
from walkcore.errors import InvalidValueError
from walkcore.scenario.lesson import KEYS, lesson_files, load_lesson, read_lesson
from walkcore.scenario.scenario import scenario_from_mapping

NAMES = list(lesson_files())
OWN = """---
title: Does it stand?
question: A robot stands. Is it still there a moment later?
walks:
  stand: {name: Standing, robot: talos, duration: 0.5}
choices:
  stands: {text: It stands., expect: {stand: {not_fallen: true, max_final_speed: 0.001}}}
  falls: {text: It falls., expect: {stand: {not_fallen: false}}}
answer: stands
show: [cop_margin]
---
Nobody <b>pushes</b> it, [or so it seems](javascript:alert(1)).

## What happened
**Nothing.**
"""


def experiment(lesson, without_body=True):
    """Metrics of each walk of a lesson."""
    return {
        name: record(walk.without_body() if without_body else walk).metrics() for name, walk in lesson.walks.items()
    }


@pytest.mark.parametrize("name", NAMES)
def test_the_experiment_of_a_lesson_proves_the_answer_that_it_explains(name):
    lesson = load_lesson(name)
    assert lesson.right(experiment(lesson)) == [lesson.answer]


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", NAMES)
def test_so_it_does_with_the_body_that_the_page_shows(name):
    lesson = load_lesson(name)
    assert lesson.right(experiment(lesson, without_body=False)) == [lesson.answer]


def test_the_five_lessons_of_the_page_are_short_and_each_has_wrong_answers():
    lessons = [load_lesson(name) for name in NAMES]
    assert len(lessons) == 5
    for lesson in lessons:
        assert 3 <= len(lesson.choices) and lesson.show
        assert len(lesson.before.split()) < 120 and len(lesson.after.split()) < 160
        assert sum(walk.duration for walk in lesson.walks.values()) < 60.0


# Claims of the texts that no metric of an answer decides.


def walked(name, walk, **parameters):
    """A walk of a lesson without its body, with other parameters."""
    source = load_lesson(name).walks[walk].source
    changed = {**source, "parameters": {**source.get("parameters", {}), **parameters}}
    return record(scenario_from_mapping(changed).without_body())


def test_an_earlier_touchdown_catches_what_could_not_be_caught():
    assert not walked("5-what-cannot-be-caught", "right", step_timing="adaptive").metrics()["has_fallen"]


@pytest.mark.exhaustive
def test_large_weights_sway_more_and_answer_a_push_more_slowly():
    lesson, sways, steps = load_lesson("3-alpha-beta-gamma"), {}, {}
    for name, scenario in lesson.walks.items():
        settled = record(scenario.without_body())["com_y"][1500:]
        sways[name] = settled.max() - settled.min()
        shoved = [*scenario.source["events"], {"t": 5.0, "push": {"impulse": [0.0, 8.0]}}]
        pushed = scenario_from_mapping({**scenario.source, "duration": 9.0, "events": shoved}).without_body()
        steps[name] = record(pushed).metrics()["recovery_steps"]
    assert sways["paper"] == pytest.approx(0.05, abs=0.005)
    assert sways["gamma"] == pytest.approx(0.08, abs=0.005)
    assert steps == {"paper": 1, "alpha": 3, "gamma": 3}


def test_the_capture_point_leaves_where_the_pressure_may_go_only_at_the_harder_push():
    for push, is_beyond in (("soft", False), ("hard", True)):
        recording = walked("1-pressure-under-the-feet", push)
        omega = (9.81 / recording.scenario.robot.com_height) ** 0.5
        dcm, cop = recording["com_x"] + recording["com_vx"] / omega, recording["cop_x"]
        first = slice(200, 250)  # ticks from the push on, before a foot could land
        assert cop[first].max() == pytest.approx(0.07, abs=0.002)
        assert (dcm[first].max() > 0.07) == is_beyond


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("title: Does it stand?\n", "", "title = None: must be a text"),
        ("answer: stands", "answer: runs", "answer = 'runs': must be one of stands, falls"),
        ("max_final_speed", "max_speed", "choices.stands.expect.max_speed"),
        ("robot: talos", "robot: nobody", "walks.stand = 'nobody': no robot"),
        ("duration: 0.5", "duration: -1", "walks.stand.duration = -1"),
        ("show: [cop_margin]", "show: [beauty]", "show = ['beauty']: must be a list of"),
        ("show: [cop_margin]", "show: [[1]]", "show = [[1]]: must be a list of"),
        ("expect: {stand: {not_fallen: false}}", "expect: {stand: {}}", "choices.falls.expect"),
        ("expect: {stand: {not_fallen: false}}", "expect: {run: {}}", "choices.falls.expect.run"),
        ("## What happened", "## And then", "must have a line '## What happened'"),
        ("---\n", "", "must begin with YAML"),
        ("walks:", "waltzes:", "lesson.waltzes"),
        ("title:", "title: [", "is not YAML"),
    ],
)
def test_a_file_that_is_no_lesson_is_refused_by_field_value_and_limit(tmp_path, old, new, words):
    assert old in OWN
    file = tmp_path / "own.md"
    file.write_text(OWN.replace(old, new))
    with pytest.raises(InvalidValueError) as refused:
        load_lesson(file)
    assert words in str(refused.value)


def test_a_file_of_another_size_or_encoding_is_refused_too(tmp_path):
    for content in (OWN.encode() + b"x" * 50_000, OWN.encode() + b"\xff"):
        (tmp_path / "own.md").write_bytes(content)
        with pytest.raises(InvalidValueError):
            load_lesson(tmp_path / "own.md")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A teacher's folder: one lesson of its own, and one file that is none."""
    folder = tmp_path_factory.mktemp("lessons")
    (folder / "0-own.md").write_text(OWN)
    (folder / "9-bad.md").write_text("nothing")
    (folder / "notes.txt").write_text("not a lesson")
    return folder


@pytest.fixture(scope="module")
def server(folder) -> Iterator[Server]:
    with serving("--scene", "light", WALK_LESSONS=str(folder)) as server:
        yield server


def done(api: httpx.Client, scenario: dict) -> str:
    """Id of a run of a scenario that is done."""
    run = api.post("runs", json=scenario).json()["id"]
    assert ended(api, f"runs/{run}")["status"] == "done"
    return run


def test_a_lesson_is_added_by_a_file_tried_and_judged_by_rest(api, server):
    lessons = {lesson["name"]: lesson for lesson in api.get("lessons").json()}
    assert list(lessons) == ["0-own", *NAMES]
    wait_for(lambda: any("9-bad is no lesson" in line for line in server.output))
    own = lessons["0-own"]
    assert "answer" not in own and "expect" not in str(own["choices"])  # what is to be guessed stays secret
    assert "&lt;b&gt;" in own["before"] and "href" not in own["before"]
    run = done(api, own["walks"][0]["scenario"])
    outcome = api.get("lessons/0-own/outcome", params={"run": run}).json()
    assert outcome["right"] == [outcome["answer"]] == ["stands"]
    assert [verdict["holds"] for verdict in outcome["verdicts"]["stands"]] == [True, True]
    assert outcome["verdicts"]["falls"][0]["measured"] is True
    assert outcome["measured"][0]["values"]["stand"] == pytest.approx(0.1, abs=0.001)
    assert outcome["after"] == "<p><strong>Nothing.</strong></p>\n"


def test_an_experiment_that_is_not_the_lessons_own_is_refused(api):
    own = api.get("lessons").json()[0]["walks"][0]["scenario"]
    other = done(api, own | {"duration": 0.4})
    asked = {
        404: ["lessons/7-none/outcome?run=1", "lessons/0-own/outcome?run=1"],
        422: ["lessons/0-own/outcome", f"lessons/0-own/outcome?run={other}", "lessons/0-own/outcome?run=1&run=2"],
    }
    assert {path: api.get(path).status_code for paths in asked.values() for path in paths} == {
        path: code for code, paths in asked.items() for path in paths
    }
    behind = [api.post("runs", json=own | {"duration": 60.0}).json()["id"] for _ in range(4)]  # which keep it waiting
    waiting = api.post("runs", json=own).json()["id"]
    assert api.get("lessons/0-own/outcome", params={"run": waiting}).status_code == 409
    for run in (waiting, *behind):
        api.delete(f"runs/{run}")


def test_a_shipped_lesson_can_be_replaced_and_a_folder_may_be_missing(tmp_path, api):
    shutil.copy(str(lesson_files()[NAMES[0]]), tmp_path / f"{NAMES[0]}.md")
    files = lesson_files(tmp_path)
    assert list(files) == NAMES
    assert read_lesson("own", files[NAMES[0]]).title == load_lesson(NAMES[0]).title
    assert str(files[NAMES[0]]).startswith(str(tmp_path))


# A browser calls an observer once all is done that follows from a change, so a walk that was not shown leaves no trace.
NOTES_WATCHING = """addEventListener("DOMContentLoaded", () => {
  const note = ([{ target }]) => (window.watched ||= target.classList.contains("is-watching"));
  const card = document.getElementById("lesson"); // which the frame of the scene does not have
  if (card) new MutationObserver(note).observe(card, { attributeFilter: ["class"] });
});"""


@pytest.mark.exhaustive
def test_the_page_asks_shows_the_walk_and_says_what_it_measured(visit, server, api):
    page = visit(f"{server.url}#lesson=0-own", before=NOTES_WATCHING)
    expect(page.locator("#lesson-title")).to_have_text("Does it stand?")
    expect(page.locator("#lesson-run")).to_be_disabled()
    page.locator("#lesson label", has_text="It falls.").click()
    page.locator("#lesson-run").click()
    expect(page.locator("#lesson-state")).to_contain_text("You see: Standing")
    state = page.locator("#lesson-state")
    expect(state).to_have_text("The experiment says otherwise: It stands.")
    expect(page.locator("#lesson-result td")).to_have_text("10.0 cm")
    expect(page.locator("#lesson-after strong")).to_have_text("Nothing.")
    assert page.evaluate("window.watched")
    page.locator("#lesson-again button").click()
    expect(state).to_contain_text("You see: Standing")
    expect(state).to_have_text("The experiment says otherwise: It stands.")
    page.locator("#lesson-next").click()
    expect(page.locator("#lesson-title")).to_have_text(load_lesson(NAMES[0]).title)
    expect(page.locator("#lesson-result")).to_be_hidden()
    page.locator("#lesson-end").click()
    expect(page.locator("#lesson")).to_be_hidden()
    page.close()


def test_the_command_tries_a_lesson_and_says_what_it_proves(tmp_path):
    file = tmp_path / "own.md"
    file.write_text(OWN)
    said = walk("lessons", file)
    assert said.returncode == 0 and "It stands." in said.stdout and "final_speed" in said.stdout
    file.write_text(OWN.replace("answer: stands", "answer: falls"))
    said = walk("lessons", file)
    assert said.returncode == 1 and "falls" in said.stdout
    file.write_text(OWN.replace("answer: stands", ""))
    said = walk("lessons", file)
    assert said.returncode == 2 and "answer" in said.stderr
    assert set(NAMES) <= set(walk("lessons").stdout.split())


def test_the_example_of_the_documents_proves_its_answer_and_every_lesson_and_key_is_told(tmp_path):
    text = (Path(__file__).parent.parent / "docs" / "lessons.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```markdown\n(.*?)```", text, flags=re.DOTALL)
    (tmp_path / "6-braking.md").write_text(example)
    lesson = load_lesson(tmp_path / "6-braking.md")
    assert lesson.right(experiment(lesson)) == [lesson.answer]
    told = re.findall(r"^\| (`.*?`) \|", text, flags=re.MULTILINE)
    assert {name for cell in told for name in re.findall(r"`([\w-]+)`", cell)} == {*NAMES, *KEYS}
