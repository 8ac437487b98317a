import base64
import io
import json
import math
import re
from collections import Counter
from pathlib import Path

import jsonschema
import msgpack
import numpy as np
import polars
import pyarrow.parquet as pq
import pytest
import zstandard
from google.protobuf.unknown_fields import UnknownFieldSet
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from app.formats import FORMATS, unit, write_run
from walkcore import Simulation, record
from walkcore.mpc.stance import Side
from walkcore.scenario.recording import Recording, collect
from walkcore.scenario.replay import replayed
from walkcore.scenario.scenario import scenario_from_mapping

EVENTS = [
    {"t": 0.1, "reference": {"vx": 0.2, "yaw_rate": 0.1}},
    {"t": 1.0, "push": {"impulse": [0.0, 3.0]}},
    {"t": 1.2, "parameters": {"alpha": 1e-5}},
]


@pytest.fixture(scope="module", params=["hrp2", "talos"])
def recording(request) -> Recording:
    parameters = {"control_period": 0.02, "initial_double_support_duration": 0.3}
    return record(
        scenario_from_mapping(
            {"name": "short", "robot": request.param, "duration": 1.6, "parameters": parameters, "events": EVENTS}
        )
    )


@pytest.fixture(scope="module")
def folder(recording, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    write_run(recording, folder, tuple(FORMATS))
    return folder


def test_the_same_recording_gives_the_same_bytes(recording, folder, tmp_path):
    for ending in FORMATS:
        FORMATS[ending].write(recording, recording.run_json(), tmp_path / ending)
        assert (tmp_path / ending).read_bytes() == (folder / FORMATS[ending].file).read_bytes(), ending


def test_parquet_reads_back(recording, folder):
    table = polars.read_parquet(folder / "recording.parquet")
    assert tuple(table.columns) == recording.columns
    assert np.array_equal(table.to_numpy(), recording.rows, equal_nan=True)
    assert table["tick"].dtype == polars.Int64
    schema = pq.read_schema(folder / "recording.parquet")
    assert json.loads(schema.metadata[b"walk.run.json"]) == json.loads((folder / "run.json").read_text())
    assert schema.field("com_vx").metadata[b"unit"] == b"m/s"


def test_every_column_has_a_unit(recording):
    units = {name: unit(name) for name in recording.columns}
    assert units["jerk_x"] == "m/s^3" and units["foothold2_yaw"] == "rad" and units["com_offset_x"] == "m"
    assert units["true_cop_y"] == "m" and units["reference_vy"] == "m/s" and units["status"] == ""


def messages_of(folder):
    """Schema, topic, time [ns] and content of every message, decoded by the schema that the file carries."""
    decoders, found = DecoderFactory(), []
    for schema, channel, message in make_reader(io.BytesIO((folder / "recording.mcap").read_bytes())).iter_messages():
        if channel.topic == "/walk/row":
            assert (channel.message_encoding, schema.encoding) == ("json", "jsonschema")
            content = json.loads(message.data)
        else:
            assert (channel.message_encoding, schema.encoding) == ("protobuf", "protobuf")
            content = decoders.decoder_for("protobuf", schema)(message.data)
        found.append((schema, channel.topic, message.log_time, content))
    return found


def test_mcap_holds_every_row_and_run_json(recording, folder):
    rows = [content for _, topic, _, content in messages_of(folder) if topic == "/walk/row"]
    assert tuple(rows[0]) == recording.columns
    values = np.array([[math.nan if value is None else value for value in row.values()] for row in rows])
    assert np.array_equal(values, recording.rows, equal_nan=True)
    reader = make_reader(io.BytesIO((folder / "recording.mcap").read_bytes()))
    attached = {a.name: a.data for a in reader.iter_attachments()}
    assert attached["run.json"] == (folder / "run.json").read_bytes()


def test_mcap_messages_fit_their_schemas_and_foxglove_knows_their_names(recording, folder):
    has_body = recording.scenario.robot.body is not None
    kinds, nb_seen = {}, Counter()
    for schema, topic, _, content in messages_of(folder):
        nb_seen[topic] += 1
        if topic != "/walk/row":
            assert content.DESCRIPTOR.full_name == schema.name and not len(UnknownFieldSet(content))
        elif nb_seen[topic] % 20 == 1:  # validating all of them takes seconds
            jsonschema.validate(content, json.loads(schema.data))
        kinds[topic] = schema.name
    expected = {
        "/walk/row": "walk.Row",
        "/tf": "foxglove.FrameTransforms",
        "/walk/scene": "foxglove.SceneUpdate",
        "/walk/footholds": "foxglove.PosesInFrame",
        "/walk/com": "foxglove.PoseInFrame",
        "/walk/cop": "foxglove.PoseInFrame",
    }
    if has_body:
        expected |= {"/walk/true_cop": "foxglove.PoseInFrame", "/walk/joints": "foxglove.JointStates"}
    assert kinds == expected


def test_mcap_puts_the_links_where_the_soles_are(recording, folder):
    body = recording.scenario.robot.body
    if body is None:
        pytest.skip("no links")
    frames = [(at, content.transforms) for _, topic, at, content in messages_of(folder) if topic == "/tf"]
    at, transforms = frames[-1]
    k = round(at * 1e-9 / 0.02)
    where = {t.child_frame_id: t.translation for t in transforms}
    for foot in ("left", "right"):
        link = where[f"leg_{foot}_6_link"]  # 10.7 cm above the sole of Talos
        sole = [recording[f"{foot}_{axis}"][k] for axis in "xyz"]
        assert [link.x, link.y, link.z - 0.107] == pytest.approx(sole, abs=1e-3)
    assert where["com"].x == recording["com_x"][k]


def test_the_push_is_seen_in_the_scene(folder):
    scenes = [(at, content) for _, topic, at, content in messages_of(folder) if topic == "/walk/scene"]
    arrows = {at: e.arrows for at, content in scenes for e in content.entities if e.id == "push"}
    seen = [at * 1e-9 for at, arrow in arrows.items() if arrow]
    assert 1.0 <= min(seen) <= 1.05 and 1.4 < max(seen) < 1.6


def test_snapshots_of_a_recording_are_those_it_was_made_of(recording):
    again = list(replayed(recording, every=7))
    assert [s.tick for s in again] == list(range(0, 80, 7))
    for s in again:
        k = s.tick
        assert s.com.velocity[0] == recording["com_vx"][k] and s.right_foot.yaw == recording["right_yaw"][k]
        assert (s.q is None) == (recording.scenario.robot.body is None)
        assert [f.side for f in s.plan.footholds] == [s.support.side.other, s.support.side][: len(s.plan.footholds)]
        if k + 1 < len(recording.rows):  # no push there
            assert s.plan.com[0, 0] == pytest.approx(recording["com_x"][k + 1], abs=1e-12)


@pytest.fixture(scope="module")
def physics():
    """A walk in contact physics with an ideal twin, and the snapshots that it was made of."""
    pytest.importorskip("mujoco", reason="mujoco-core is not installed on this platform")
    parameters = {"plant": "mujoco", "twin": True, "initial_double_support_duration": 0.1}
    events = [{"t": 0.0, "reference": {"vx": 0.3}}]
    scenario = scenario_from_mapping({"duration": 0.5, "parameters": parameters, "events": events})
    simulation = Simulation(scenario.robot, scenario.parameters)
    snapshots = [simulation.step(command) for command in scenario.commands()]
    return collect(scenario, snapshots, simulation.body), snapshots


def test_robot_and_twin_are_replayed_as_they_were_measured(physics):
    recording, snapshots = physics
    for again in replayed(recording, every=9):
        lived = snapshots[again.tick]
        for one, other in ((again, lived), (again.twin, lived.twin)):
            np.testing.assert_array_equal(one.q, other.q)
            np.testing.assert_array_equal(one.com.position, other.com.position)
            assert one.right_foot.height == other.right_foot.height
        now, then = again.plant, lived.plant
        np.testing.assert_array_equal(now.q_commanded, then.q_commanded)
        np.testing.assert_array_equal(now.measured.com, then.measured.com)
        np.testing.assert_array_equal(now.dcm_error, then.dcm_error)
        for side in Side:
            np.testing.assert_array_equal(now.measured.soles[side].position, then.measured.soles[side].position)
            assert now.contact.forces[side] == then.contact.forces[side]
        assert (now.contact.cop is None) == (then.contact.cop is None)


def test_every_column_of_physics_has_its_unit(physics):
    units = {name: unit(name) for name in physics[0].columns}
    assert units["left_force"] == "N" and units["measured_com_vx"] == "m/s" and units["twin_status"] == ""
    assert units["q_commanded_9"] == units["twin_q_9"] == "rad" and units["twin_q_3"] == ""


def test_the_replay_is_one_page_that_holds_everything(folder):
    page = (folder / "recording.html").read_text()
    assert len(page) < 15e6
    assert "<title>short</title>" in page


def test_the_replay_walks_where_the_recording_did(recording, folder):
    page = (folder / "recording.html").read_text()
    packed = base64.b64decode(re.search(r'__VISER_EMBED_DATA__="([^"]+)"', page)[1])
    plain = zstandard.ZstdDecompressor().decompress(packed[8:])
    content = msgpack.unpackb(plain[8 : 8 + int.from_bytes(plain[:8], "little")])
    moves = [
        (t, message["position"])
        for t, message in content["messages"]
        if message["type"] == "SetPositionMessage" and message["name"] == "/w/com/mass"
    ]
    assert len(moves) > 30 and content["durationSeconds"] == pytest.approx(1.6, abs=0.05)
    for t, (x, y, _) in moves[2:]:
        k = round(t / 0.02)
        assert [x, y] == pytest.approx([recording["com_x"][k], recording["com_y"][k]], abs=1e-5)
    # One that is loaded anew each time the walk begins again keeps a browser without a graphics card white.
    lights = [message for _, message in content["messages"] if message["type"] == "EnvironmentMapMessage"]
    assert [light["hdri_data"] for light in lights] == [None]
