"""Imports go down the layers only."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

# From the ground up; what stands on one line knows nothing of each other or is listed in order.
CORE = """
    errors values stages cache
    command lipm schemes qp parameters
    gait
    orientation regions robot
    capture supports preview walking_qp
    pattern_generator
    swing_foot
    dynamic_filter
    whole_body
    collisions inscribed step_trial footholds
    snapshot state simulation
    expectations events scenario
    walk margins steady_walking push_follower recovery metrics
    recording session replay
""".split()
SERVER = """
    cores live
    metrics palette outlines scenario_schema schemas body_limit origin token settings
    viewer proxy
    formats
    runs run_schemas errors
    page
    bench
    figures
    report
    footholds foothold_picture foothold_report
    batch run_commands
    routes
    main serve cli
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
    """Where a full name lies among the layers of a package; none if elsewhere."""
    parts = name.split(".")
    return layers.index(parts[1]) if parts[0] == package and len(parts) > 1 and parts[1] in layers else None


def upward_imports(path: Path, package: str, layers: list[str]) -> set[str]:
    """What a file imports from its own package that does not lie below it."""
    part = path.relative_to(ROOT / package).parts[0].removesuffix(".py")
    assert part in layers, f"{package}.{part} has no layer: give it one here"
    own = layers.index(part)
    found = {name: layer(name, package, layers) for name in imports(path)}
    return {name for name, at in found.items() if at is not None and at >= own and name.split(".")[1] != part}


@pytest.mark.parametrize("path", modules("walkcore"), ids=lambda path: path.stem)
def test_core_knows_nothing_of_the_server_nor_of_clocks_threads_and_the_web(path):
    roots = {name.split(".")[0] for name in imports(path)}
    strangers = {"app", "time", "threading", "asyncio", "viser", "fastapi", "pydantic", "uvicorn", "websockets", "os"}
    assert roots & strangers == set()


LAYERED = [("walkcore", CORE, path) for path in modules("walkcore")] + [
    ("app", SERVER, path) for path in modules("app")
]


@pytest.mark.parametrize(("package", "layers", "path"), LAYERED, ids=lambda value: getattr(value, "stem", ""))
def test_imports_go_down(package, layers, path):
    if path.parent != ROOT / package or path.name != "__init__.py":  # those two only name what the package offers
        assert upward_imports(path, package, layers) == set()
        assert package not in imports(path) or package == "app", "a module of the core names the module it needs"


def test_every_layer_exists():
    for package, layers in (("walkcore", CORE), ("app", SERVER)):
        for name in layers:
            assert (ROOT / package / f"{name}.py").exists() or (ROOT / package / name).is_dir(), name


def test_only_the_settings_read_the_environment():
    readers = [
        path.name for path in modules("app") if "getenv" in path.read_text() or "os.environ[" in path.read_text()
    ]
    assert readers == []
    assert [path.name for path in modules("app") if "pydantic_settings" in str(imports(path))] == ["settings.py"]


def test_only_one_file_knows_solvers():
    assert [path.name for path in modules("walkcore") if {"piqp", "daqp"} & imports(path)] == ["qp.py"]


def test_only_the_viewer_and_its_proxy_know_viser():
    knowing = {path.relative_to(ROOT / "app").parts[0] for path in modules("app") if "viser" in imports(path)}
    assert knowing == {"viewer", "proxy.py"}
