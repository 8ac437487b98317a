"""Imports go down the layers only."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

# From the ground up: a module of the core, and a folder of the server, may import those before it.
CORE = """
    errors values plain_yaml named_files stages cache
    command
    mpc.lipm mpc.stance mpc.horizon mpc.gait mpc.orientation mpc.regions mpc.capture
    mpc.preview mpc.objective mpc.schemes mpc.qp
    parameters robot robot_file
    mpc.viability mpc.balance_sets
    mpc.supports mpc.constraints mpc.walking_qp
    mpc.plan mpc.plan_checks mpc.pattern_generator mpc.touchdowns mpc.step_timing
    motion.swing_foot motion.dynamic_filter motion.body_model motion.shapes motion.whole_body
    footholds.collisions footholds.safe_polygon footholds.step_feasibility footholds.study
    plant.plant plant.world plant.fall_watch plant.stabilizer plant.sensors plant.mujoco_model plant.mujoco_plant
    plant.driver_state plant.driver
    methods.situation methods.trajectory methods.method methods.sugihara methods.morisawa methods.dcm_tracker
    methods.planning
    pushes model methods planner snapshot coupling state simulation
    scenario.expectations scenario.events scenario.scenario scenario.scaling scenario.lesson
    analysis.columns analysis.margins analysis.steady_walking analysis.push_recovery analysis.twin
    analysis.metrics analysis.push_bound analysis.survival analysis.push_rose
    analysis.sweep analysis.cell_outcome
    robot_import.urdf_checks robot_import.legs robot_import.soles robot_import.measure robot_import.findings
    robot_import.swing_fit robot_import.speed_limits robot_import
    scenario.recording scenario.session scenario.replay
""".split()
SERVER = """
    settings descriptions tables jobs robot_files robot_choices drawing robot_picture live viewer robot_switch formats
    work runs http bench report footholds sweeps figures routes main commands
""".split()


def modules(package: str) -> list[Path]:
    return sorted(path for path in (ROOT / package).rglob("*.py"))


def imports(path: Path) -> set[str]:
    """Full names of what a file imports, wherever in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names |= {str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def layer(name: str, package: str, layers: list[str]) -> int | None:
    """Number of the layer of a full name in its package; none if elsewhere."""
    inside = name.removeprefix(f"{package}.")
    return next((i for i, part in enumerate(layers) if name != inside and f"{inside}.".startswith(f"{part}.")), None)


def upward_imports(path: Path, package: str, layers: list[str]) -> set[str]:
    """Imports of a file from its own package that do not lie below it."""
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    own = layer(name, package, layers)
    assert own is not None, f"{name} has no layer: give it one here"
    found = {name: layer(name, package, layers) for name in imports(path)}
    return {name for name, at in found.items() if at is not None and at > own}


@pytest.mark.parametrize("path", modules("walkcore"), ids=lambda path: path.stem)
def test_core_knows_nothing_of_the_server_nor_of_clocks_threads_and_the_web(path):
    roots = {name.split(".")[0] for name in imports(path)}
    strangers = {"app", "time", "threading", "asyncio", "viser", "fastapi", "pydantic", "uvicorn", "websockets", "os"}
    assert roots & strangers == set()


CORE_FOLDERS = {name.partition(".")[0] for name in CORE if "." in name}
LAYERED = [("walkcore", CORE, path) for path in modules("walkcore")] + [
    ("app", SERVER, path) for path in modules("app")
]


@pytest.mark.parametrize(("package", "layers", "path"), LAYERED, ids=lambda value: getattr(value, "stem", ""))
def test_imports_go_down(package, layers, path):
    if path.name != "__init__.py" or path.parent.name not in (package, *CORE_FOLDERS):  # those only name what is inside
        assert upward_imports(path, package, layers) == set()
        assert package not in imports(path) or package == "app", "a module of the core names the module it needs"


def test_every_layer_exists():
    for package, layers in (("walkcore", CORE), ("app", SERVER)):
        for name in layers:
            place = ROOT / package / name.replace(".", "/")
            assert place.with_suffix(".py").exists() or place.is_dir(), name


SYSTEM = {"environ", "environb", "getenv", "cpu_count", "process_cpu_count", "sched_getaffinity", "cpu_affinity"}


def names(path: Path) -> set[str]:
    """Every attribute and variable that a file reads or writes, and every name that it imports."""
    found = {name.rpartition(".")[2] for name in imports(path)}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, (ast.Attribute, ast.Name)):
            found.add(node.attr if isinstance(node, ast.Attribute) else node.id)
    return found


def test_only_the_settings_read_the_environment_and_the_size_of_the_machine():
    readers = [path.name for path in modules("app") if SYSTEM & names(path)]
    assert readers == ["settings.py"]
    assert [path.name for path in modules("app") if "pydantic_settings" in str(imports(path))] == ["settings.py"]


@pytest.mark.parametrize(
    "line",
    [
        "os.environ['A']",
        "os.environ.get('A')",
        "os.environ.setdefault('A', '')",
        "os.getenv('A')",
        "from os import environ as e",
        "os.cpu_count()",
        "multiprocessing.cpu_count()",
        "len(os.sched_getaffinity(0))",
    ],
)
def test_every_way_to_the_environment_and_the_size_of_the_machine_is_seen(tmp_path, line):
    (tmp_path / "reader.py").write_text(line)
    assert SYSTEM & names(tmp_path / "reader.py")


# Prints the number of threads that numpy finds when it is first looked for.
WATCHING_NUMPY = """
import os, sys
class Watch:
    def find_spec(self, name, path=None, target=None):
        if name == "numpy":
            print(os.environ.get("OPENBLAS_NUM_THREADS"))
sys.meta_path.insert(0, Watch())
import app.commands.cli
"""


def test_the_algebra_library_has_one_thread_when_numpy_loads():
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    found = subprocess.run([sys.executable, "-c", WATCHING_NUMPY], env=environment, capture_output=True, text=True)
    assert found.stdout.split()[:1] == ["1"], found.stderr


def test_only_one_file_knows_solvers():
    assert [path.name for path in modules("walkcore") if {"piqp", "daqp"} & imports(path)] == ["qp.py"]


def test_only_the_viewer_knows_viser():
    knowing = {path.relative_to(ROOT / "app").parts[0] for path in modules("app") if "viser" in imports(path)}
    assert knowing == {"viewer"}
