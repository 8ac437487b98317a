"""Viewer of the walking robot, drawn with viser.

scene/         what is drawn
panel/         controls beside it
transport/     how changes reach the browsers
viewer         the task that draws the live robot
past_look      an earlier tick in the scene of one browser
replay_page    a recording as a page
"""

from app.viewer.past_look import PastLook
from app.viewer.scene.frame import LIGHT, RenderQuality
from app.viewer.transport.client_registry import LIGHT_PATH
from app.viewer.transport.viser_private import CLIENT_PAGE
from app.viewer.viewer import TooManyLooksError, Viewer

__all__ = ["CLIENT_PAGE", "LIGHT", "LIGHT_PATH", "PastLook", "RenderQuality", "TooManyLooksError", "Viewer"]
