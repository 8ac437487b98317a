"""Each addition that docs/architecture.md describes works once it is made at the one place that the page names.

All are made in a copy of the code, which then serves the toy robot; the server must have no trouble with any of them.
"""

import shutil
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from conftest import ended, serving, wait_for

ROOT = Path(__file__).parent.parent

TERM = '''def com_above_stance(preview):
    """CoM at the samples against the centres of their stances [m]."""
    return preview.beside_stance(preview.lipm.Pps, preview.lipm.Ppu)


'''
SCHEME = """        "toy": Scheme(
            "a toy", lambda w: (Term(w.alpha, jerk), Term(w.beta, velocity), Term(w.toy_weight, com_above_stance))
        ),
"""
WEIGHT = '''    toy_weight: float = 1e-3
    """Weight of the distance from the CoM to the centre of its stance in `toy`."""
'''
WEIGHT_LIMITS = """        "toy_weight": (0.0, 1e3),
"""
LAYER = """class Heading:
    def __init__(self, canvas):
        self._node = f"{canvas.root}/axes"
        canvas.server.scene.add_frame(self._node)

    def update(self, updates, frame):
        updates.on_ground(self._node, frame.snapshot.com.position, frame.snapshot.heading)


"""
LAYER_ENTRY = """    "heading": Layer("heading", "Direction that the robot faces", draw=Heading),
"""
FORMAT = """            Format("ticks", "text/plain", "nb of ticks", lambda r, _, p: p.write_text(str(len(r["t"])))),
"""
ROUTE = '''@router.get("/mass")
async def mass(runner: LiveRunner) -> float:
    """Mass of the robot that walks [kg]."""
    return runner.robot.mass


'''


def insert(path: Path, before: str, text: str) -> None:
    """Insert a text into a file, before one that it holds once."""
    source = path.read_text(encoding="utf-8")
    assert source.count(before) == 1, before
    path.write_text(source.replace(before, text + before), encoding="utf-8")


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    copy = tmp_path_factory.mktemp("copy")
    for folder in ("walkcore", "app", "static"):
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))
    insert(copy / "walkcore/mpc/schemes.py", "SCHEMES: Mapping", TERM)
    insert(copy / "walkcore/mpc/schemes.py", '        "full": Scheme(', SCHEME)
    insert(copy / "walkcore/parameters.py", "    cop_tracking: float", WEIGHT)
    insert(copy / "walkcore/parameters.py", '        "cop_tracking": (', WEIGHT_LIMITS)
    hrp2 = (copy / "walkcore/robots/hrp2.yaml").read_text(encoding="utf-8")
    toy = hrp2.replace("name: hrp2", "name: toy").replace("mass: 56.0", "mass: 40.0")
    (copy / "walkcore/robots/toy.yaml").write_text(toy, encoding="utf-8")
    insert(copy / "app/viewer/scene/layers.py", "@dataclass", LAYER)
    insert(copy / "app/viewer/scene/layers.py", '    "robot": Layer(', LAYER_ENTRY)
    insert(copy / "app/formats/__init__.py", '            Format("npz"', FORMAT)
    insert(copy / "app/routes/service.py", '@router.get("/robots")', ROUTE)
    with serving("--robot", "toy", "--scene", "light", PYTHONPATH=str(copy)) as server, server.client() as client:
        yield client


def test_a_robot_is_one_file(api):
    assert "toy" in [robot["name"] for robot in api.get("robots").json()]
    assert api.get("health").json()["robot"] == "toy"


def test_a_scheme_is_one_entry(api):
    assert api.patch("live/parameters", json={"scheme": "toy"}).raise_for_status().json()["scheme"] == "toy"
    api.put("live/reference", json={"vx": 0.1}).raise_for_status()
    wait_for(lambda: api.get("live").json()["phase"] == 2)
    assert api.get("live").json()["status"] == 0
    assert '"toy"' in api.get(str(api.base_url.join("/openapi.json"))).text


def test_a_weight_is_one_field_with_its_limits(api):
    assert api.patch("live/parameters", json={"toy_weight": 0.01}).raise_for_status().json()["toy_weight"] == 0.01
    refusal = api.patch("live/parameters", json={"toy_weight": -1.0})
    assert refusal.status_code == 422 and "toy_weight" in refusal.text


def test_a_layer_is_one_entry(api):
    assert api.get("live/layers").json()["heading"] is True
    assert api.patch("live/layers", json={"heading": False}).raise_for_status().json()["heading"] is False


def test_a_format_is_one_entry(api):
    scenario = {"robot": "toy", "duration": 2.0, "parameters": {"control_period": 0.1, "scheme": "toy"}}
    run = api.post("runs", json=scenario).raise_for_status().json()["id"]
    assert ended(api, f"runs/{run}")["status"] == "done"
    assert api.get(f"runs/{run}/recording.ticks").raise_for_status().text == "20"


def test_a_route_is_one_function(api):
    assert api.get("mass").json() == 40.0
