"""The documents name files, commands, routes and values that exist, and the code of the README runs."""

import re
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pytest
import yaml
from fastapi import APIRouter

from app import routes as routes_folder
from app.commands import cli
from app.formats import FORMATS
from app.settings import Settings
from walkcore import load_scenario, scenario_names
from walkcore.analysis.sweep import KEYS, PUSH_KEYS, sweep_from_mapping
from walkcore.mpc.schemes import SCHEMES
from walkcore.scenario.expectations import METRICS
from walkcore.scenario.scenario import scenario_from_mapping

ROOT = Path(__file__).parent.parent
DOCUMENTS = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "benchmarks" / "README.md")
}
FOLDERS = ("walkcore", "app", "static", "tests", "benchmarks", "docs", "deploy")
WRITTEN = {  # by commands, to a user's folder
    *("growth.json", "growth.svg", "report.md", "footholds.yaml", "run.json", "sweep.json", "sweep.html", "speed.svg"),
}
MODULES = [import_module(f"app.routes.{found.name}") for found in iter_modules(routes_folder.__path__)]
ROUTERS = [value for module in MODULES for value in vars(module).values() if isinstance(value, APIRouter)]
ROUTES = {
    (method, route.path)  # pyright: ignore[reportAttributeAccessIssue]  # all of them have one
    for router in ROUTERS
    for route in router.routes
    for method in getattr(route, "methods", {"WS"})
}


def missing_links(folder: Path, text: str) -> set[str]:
    """Links of a document in a folder that lead to no file."""
    return {link for link in re.findall(r"\]\(([^)#:]+)\)", text) if not (folder / link).exists()}


def is_somewhere(name: str) -> bool:
    """Whether a file of that name is in the repository."""
    return (ROOT / name).exists() or any(True for folder in FOLDERS for _ in (ROOT / folder).rglob(name))


def missing_files(text: str) -> set[str]:
    """Files that a text names and that do not exist, by path (a module also without its ending) or by name."""
    paths = set(re.findall(rf"(?<![\w/.-])(?:{'|'.join(FOLDERS)})/[a-z][\w./-]*\w", text))
    paths = {path for path in paths if not re.search("[A-Z]{3}", path)}  # NAME in a path stands for any
    names = set(re.findall(r"`(\w+\.(?:py|js|css|html|yaml|json|svg|md))`", text)) - WRITTEN
    missing = {path for path in paths if not (ROOT / path).exists() and not (ROOT / f"{path}.py").exists()}
    return missing | {name for name in names if not is_somewhere(name)}


def commands(text: str) -> set[tuple[str, str]]:
    """Each command that a text names, with each of its options, or with an empty one."""
    lines = re.findall(r"(?:`|^ {4})walk ([a-z][^`\n#]*)", text, flags=re.MULTILINE)
    return {(line.split()[0], option) for line in lines for option in ("", *re.findall(r"--[\w-]+", line))}


def routes(text: str) -> set[tuple[str, str]]:
    """Each route that a text names, with its method, or with "" where it names none."""
    found = re.findall(r"(?:\b([A-Z]{2,})\s+)?(?:localhost:8000)?(/api/v1/[\w/{}.-]+)", text)
    return {
        (method if method in {"GET", "PUT", "POST", "PATCH", "DELETE", "WS"} else "", path) for method, path in found
    }


def is_served(method: str, path: str) -> bool:
    """Whether there is a route for a path with its parameters filled in, by any values."""
    path = path.rstrip(".")
    patterns = {(has, re.sub(r"\\{\w+\\}", "[^/]+", re.escape(route))) for has, route in ROUTES}
    return any(re.fullmatch(pattern, path) and method in ("", has) for has, pattern in patterns)


def rows(text: str, heading: str) -> list[tuple[str, ...]]:
    """Rows of the table below a heading whose first cell is code, without its backticks."""
    section = text[text.index(heading) + len(heading) :].split("\n## ")[0]
    lines = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("| `")]
    return [(first.strip("`"), *others) for first, *others in lines]


@pytest.mark.parametrize("name", DOCUMENTS)
def test_links_and_files_exist(name):
    text = DOCUMENTS[name]
    assert missing_links((ROOT / name).parent, text) | missing_files(text) == set()


def test_commands_exist(monkeypatch, capsys):
    named = set().union(*map(commands, DOCUMENTS.values()))
    assert len(named) > 10
    for command in {command for command, _ in named}:
        monkeypatch.setattr("sys.argv", ["walk", command, "--help"])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        assert ended.value.code == 0, command
        help = capsys.readouterr().out
        assert {option for name, option in named if name == command and option not in help} == set(), command


def test_targets_of_make_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = set(re.findall(r"(?:`|^ {4})make ([a-z-]+)", "\n".join(DOCUMENTS.values()), flags=re.MULTILINE))
    assert {"run", "test"} <= named <= set(re.findall(r"^([a-z-]+):", makefile, flags=re.MULTILINE))


def test_routes_exist():
    named = set().union(*map(routes, DOCUMENTS.values()))
    assert len(named) > 15
    assert {route for route in named if not is_served(*route)} == set()


def test_the_documents_list_every_scheme_scenario_metric_and_format():
    schemes = [name for name, *_ in rows(DOCUMENTS["docs/method.md"], "## Objective")]
    scenarios = {name: meaning for name, _, _, meaning in rows(DOCUMENTS["docs/scenarios.md"], "## What ships")}
    assert set(schemes) == {"scheme", *SCHEMES}
    assert scenarios == {name: load_scenario(name).description for name in scenario_names()}
    assert dict(rows(DOCUMENTS["docs/scenarios.md"], "## Metrics")) == METRICS
    assert {ending for ending, *_ in rows(DOCUMENTS["docs/scenarios.md"], "## Formats")} == set(FORMATS)


def test_the_documents_tell_every_setting():
    assert [name for name in Settings.model_fields if f"`{name.upper()}`" not in DOCUMENTS["docs/deployment.md"]] == []


def test_the_example_of_a_scenario_is_one():
    (example,) = re.findall(r"```yaml\n(.*?)```", DOCUMENTS["docs/scenarios.md"], flags=re.DOTALL)
    assert len(scenario_from_mapping(yaml.safe_load(example)).expectations) == 3


def test_the_example_of_a_sweep_is_one_and_every_key_is_told():
    text = DOCUMENTS["docs/sweeps.md"]
    (example,) = re.findall(r"```yaml\n(.*?)```", text, flags=re.DOTALL)
    assert sweep_from_mapping(yaml.safe_load(example)).nb_cells == 512
    told = {name.strip("`") for cell, *_ in rows(text, "## A sweep") for name in cell.split("`, `")}
    assert told == {*KEYS, *(f"pushes.{key}" for key in PUSH_KEYS)} - {"name", "description", "pushes"}


def test_the_architecture_lists_every_module_of_the_core():
    text = DOCUMENTS["docs/architecture.md"]
    listed = {name for cell, _ in rows(text, "## Files of the core") for name in cell.split("`, `")}
    core = ROOT / "walkcore"
    files = [path for path in core.rglob("*.py") if path.name != "__init__.py"]
    assert listed == {str(path.relative_to(core).with_suffix("")) for path in files}


def test_the_code_in_the_readme_runs(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", DOCUMENTS["README.md"], flags=re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    assert capsys.readouterr().out.strip().endswith("SOLVED")


def named_tests(text: str) -> set[tuple[str, str]]:
    """File and name of each test that a text names as `FILE::NAME`; `::NAME` is in the file that was named before."""
    found, file = set[tuple[str, str]](), ""
    for named, test in re.findall(r"`(test_\w+\.py)?(?:::(test_\w+))?`", text):
        file = named or file
        found |= {(file, test)} if test else set()
    return found


def test_every_row_of_the_threat_model_names_tests_that_exist():
    text = DOCUMENTS["docs/trust.md"]
    named = named_tests(text)
    assert len(named) > 20
    has_test = {
        (file, test)
        for file, test in named
        if re.search(rf"^(?:async )?def {test}\(", (ROOT / "tests" / file).read_text(), re.MULTILINE)
    }
    assert named - has_test == set()
    tables = [table.splitlines()[2:] for table in re.findall(r"(?:^\|.*\| test \|\n)(?:^\|.*\n)+", text, re.MULTILINE)]
    assert len(tables) >= 3
    assert [row for table in tables for row in table if "`test_" not in row] == []


def test_what_does_not_exist_is_found():
    assert missing_links(ROOT, "[a](docs/no.md) [b](README.md)") == {"docs/no.md"}
    assert missing_files("`no.py` `lipm.py` walkcore/mpc/lipm walkcore/no/lipm.py") == {"no.py", "walkcore/no/lipm.py"}
    assert commands("`walk fly --high`") == {("fly", ""), ("fly", "--high")}
    assert not is_served("GET", "/api/v1/live/push") and is_served("POST", "/api/v1/live/push")
    assert named_tests("`test_a.py::test_b`, `::test_c`") == {("test_a.py", "test_b"), ("test_a.py", "test_c")}
    assert not is_served("", "/api/v1/nowhere") and is_served("GET", "/api/v1/runs/ID/recording.{format}")
