"""The scene that shows the walking robot, drawn with viser."""

from app.viewer.scene import LIGHT, Look
from app.viewer.viewer import Viewer

__all__ = ["LIGHT", "Look", "Viewer"]
