"""Recording as a page that plays in three dimensions from disk, drawn by the same scene as the live robot."""

import html
from pathlib import Path

import viser

from app.viewer.scene.frame import LIGHT
from app.viewer.scene.scene import Scene
from app.viewer.transport.scene_updates import SceneUpdates
from app.viewer.viewer import start_server
from walkcore import Parameters, Recording
from walkcore.scenario.replay import replayed

DRAW_OVER = Path(__file__).parents[2] / "static" / "draw_over.js"
PERIOD = 1 / 30  # [s] between frames
MAX_FRAMES = 3600  # longer walks are shown with fewer frames a second, so that the page stays small
SKY, FLOOR = (255, 255, 255), (150, 150, 155)
MORE_LAYERS = ("trails",)  # beside those that the live scene shows at its start


def replay_page(recording: Recording) -> str:
    """Standalone HTML page that plays a recording."""
    server, _ = start_server()
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
    serializer = server.get_scene_serializer()  # records all that the handles are assigned
    for k, snapshot in enumerate(replayed(recording, every)):
        scene.draw(snapshot, parameters[k * every], every * period, world=recording.scenario.world)
        assign_to_handles(server, scene.updates)
        serializer.insert_sleep(every * period)
    name = html.escape(recording.scenario.name)
    page = serializer.as_html().replace("<title>Viser</title>", f"<title>{name}</title>", 1)
    script = f"{DRAW_OVER.read_text(encoding='utf-8')}\ndrawDotsOver(window);"
    return f'{page}<script type="module">{script}</script>'


def _illuminate(server: viser.ViserServer) -> None:
    """Add a sky instead of the studio, which the page would load anew, and fade in, each time the walk starts again."""
    server.scene.configure_environment_map(None)
    server.scene.add_light_hemisphere("/light/sky", sky_color=SKY, ground_color=FLOOR, intensity=1.6)


def _parameters(recording: Recording) -> list[Parameters]:
    """Parameters in force at each row."""
    scenario = recording.scenario
    found = [scenario.parameters] * len(recording.rows)
    for tick, changed in scenario.parameter_changes():
        found[tick:] = [changed] * len(found[tick:])
    return found


def assign_to_handles(server: viser.ViserServer, updates: SceneUpdates) -> None:
    """End a frame, and assign its changes to viser's handles: slower than to broadcast them, but viser records them."""
    for message in updates.changes(updates.frame):
        if "name" in message:  # not of the panel
            handle = server.scene.get_handle_by_name(message["name"])
            for field in ("position", "wxyz", "visible"):
                if field in message:
                    setattr(handle, field, message[field])
            for field, value in message.get("updates", {}).items():
                setattr(handle, field, value)
    updates.next_frame()
