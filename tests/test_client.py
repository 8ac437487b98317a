"""The examples of the documentation, run against a server."""

import json
import os
import subprocess
import sys
from pathlib import Path

import msgpack
import pytest
from conftest import Server
from websockets.sync.client import connect

DOCS = Path(__file__).parent.parent / "docs"
PATIENCE = 280.0  # [s] after which something hangs


def run_python(*words: object, **environment: str) -> str:
    outcome = subprocess.run(
        [sys.executable, *map(str, words)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        env=os.environ | {"MPLBACKEND": "Agg"} | environment,
    )
    assert outcome.returncode == 0, outcome.stderr
    return outcome.stdout


def test_the_client_of_the_documentation_follows_the_robot(server: Server):
    lines = run_python(DOCS / "client.py", server.url, 1.0).splitlines()
    times = [float(line.split()[1]) for line in lines]
    assert len(times) >= 2 and times == sorted(times) and times[-1] > times[0]


@pytest.mark.exhaustive
def test_the_notebook_runs(server: Server, tmp_path):
    cells = json.loads((DOCS / "client.ipynb").read_text(encoding="utf-8"))["cells"]
    assert all(cell["outputs"] for cell in cells if cell["cell_type"] == "code"), "make notebook"
    script = tmp_path / "notebook.py"
    script.write_text("\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"))
    run_python(script, WALK_SERVER=server.url)


def test_messagepack_says_the_same_as_json(server: Server):
    with server.client() as api:
        api.post("live/pause").raise_for_status()
        with (
            connect(server.socket_url("stream?format=msgpack")) as packed,
            connect(server.socket_url("stream")) as text,
        ):
            one, other = msgpack.unpackb(packed.recv(PATIENCE)), json.loads(text.recv(PATIENCE))
        api.post("live/resume")
    assert one["tick"] == other["tick"] and one["q"] == other["q"] and one["plan"] == other["plan"]


def test_an_unknown_format_of_the_stream_is_refused(server: Server):
    with pytest.raises(Exception, match="403"), connect(server.socket_url("stream?format=xml")):
        pass
