"""A recording as a page that plays in 3-D from disk, drawn by the same scene as the live robot."""

import contextlib
import html
import io

import viser
from viser import _messages
from viser.infra import StateSerializer

from app.viewer.scene.scene import LIGHT, Scene
from app.viewer.transport.stream import Stream
from app.viewer.viewer import CAMERA_POSITION, CAMERA_TARGET, FIELD_OF_VIEW
from walkcore import Parameters, Recording
from walkcore.scenario.replay import replayed

PERIOD = 1 / 30  # [s] between frames
MAX_FRAMES = 3600  # longer walks are shown with fewer frames a second, so that the page stays small
SKY, FLOOR = (255, 255, 255), (150, 150, 155)
MORE_LAYERS = ("trails",)  # beside those that the live scene shows at its start


def replay_page(recording: Recording) -> str:
    """A standalone HTML page."""
    with contextlib.redirect_stdout(io.StringIO()):  # viser would print an address that nobody should open
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            return _played(server, recording)
        finally:
            server.stop()


def _played(server: viser.ViserServer, recording: Recording) -> str:
    parameters = list(_parameters(recording))
    fewest = -(-len(recording.rows) // MAX_FRAMES)
    period = float(recording.parameters["control_period"])
    every = max(1, round(PERIOD / period), fewest)
    scene = Scene(server, recording.scenario.robot, LIGHT)
    _illuminate(server)
    for layer in MORE_LAYERS:
        scene.show(layer, True)
    camera = server.initial_camera
    camera.position, camera.look_at, camera.fov = CAMERA_POSITION, CAMERA_TARGET, FIELD_OF_VIEW
    serializer = server.get_scene_serializer()
    for k, snapshot in enumerate(replayed(recording, every)):
        scene.draw(snapshot, parameters[k * every], every * period)
        _keep(serializer, scene.stream)
        serializer.insert_sleep(every * period)
    name = html.escape(recording.scenario.name)
    return serializer.as_html().replace("<title>Viser</title>", f"<title>{name}</title>", 1)


def _illuminate(server: viser.ViserServer) -> None:
    """By a sky in place of the studio, which the page would load anew, and fade in, each time the walk begins again."""
    server.scene.configure_environment_map(None)
    server.scene.add_light_hemisphere("/light/sky", sky_color=SKY, ground_color=FLOOR, intensity=1.6)


def _parameters(recording: Recording) -> list[Parameters]:
    """In force at each row."""
    scenario = recording.scenario
    found = [scenario.parameters] * len(recording.rows)
    for tick, changed in scenario.parameter_changes():
        found[tick:] = [changed] * len(found[tick:])
    return found


def _keep(serializer: StateSerializer, stream: Stream) -> None:
    """End a frame of the stream, and put what it changes into the page."""
    for message in stream.changes(stream.frame):
        kind = getattr(_messages, message.pop("type"))
        message.pop("owner", None)
        serializer._insert_message(kind(**message))
    stream.next_frame()
