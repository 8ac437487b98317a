"""A recording as a page that plays in 3-D from disk, drawn by the same scene as the live robot."""

import contextlib
import io

import viser

from app.viewer.scene import LIGHT, Scene
from app.viewer.viewer import CAMERA_POSITION, CAMERA_TARGET, FIELD_OF_VIEW
from walkcore import Recording
from walkcore.replay import replayed

PERIOD = 1 / 30  # [s] between frames
MAX_FRAMES = 3600  # longer walks are shown with fewer frames a second, so that the page stays small


def replay_page(recording: Recording) -> str:
    """A standalone HTML page."""
    p = recording.parameters
    fewest = -(-len(recording.rows) // MAX_FRAMES)
    every = max(1, round(PERIOD / p["control_period"]), fewest)
    with contextlib.redirect_stdout(io.StringIO()):  # viser would print an address that nobody should open
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        scene = Scene(server, recording.scenario.robot, LIGHT)
        camera = server.initial_camera
        camera.position, camera.look_at, camera.fov = CAMERA_POSITION, CAMERA_TARGET, FIELD_OF_VIEW
        serializer = server.get_scene_serializer()
        for snapshot in replayed(recording, every):
            scene.draw(snapshot, every * p["control_period"])
            serializer.insert_sleep(every * p["control_period"])
        return serializer.as_html()
    finally:
        server.stop()
