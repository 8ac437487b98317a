"""The scene that shows the walking robot, drawn with viser."""

from app.viewer.scene.scene import LIGHT, Look
from app.viewer.transport.light_clients import LIGHT_PATH
from app.viewer.viewer import Viewer

__all__ = ["LIGHT", "LIGHT_PATH", "Look", "Viewer"]
