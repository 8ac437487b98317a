"""Scene and plots of one browser that looks at an earlier tick, over the nodes that all browsers share.

viser's nodes are the same for all browsers. But our changes of them go to each browser by the broadcaster, so that one
can be sent others: those of a second scene, whose drawings make no nodes, since the live one's have made all of them.
"""

from collections.abc import Sequence, Set
from typing import Any

from app.viewer.panel.plots_tab import PlotsTab, PlottedTime
from app.viewer.scene.frame import RenderQuality
from app.viewer.scene.scene import Scene
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import Parameters, Robot, Snapshot
from walkcore.plant.world import World

FRAMES_PER_PLOT = 6  # as the panel's


class NodesThatExist:
    """Stands for a viser server all of whose nodes have been made: takes every call, and does nothing."""

    def __getattr__(self, _: str) -> "NodesThatExist":
        """Any part of it, or any method."""
        return self

    def __call__(self, *_: Any, **__: Any) -> "NodesThatExist":
        """A method that does nothing."""
        return self

    def __setattr__(self, _: str, __: Any) -> None:
        """Forget what is assigned."""


class PastLook:
    """An earlier tick in the scene and the plots of one browser. Drawn in viser's event loop."""

    def __init__(self, robot: Robot, quality: RenderQuality) -> None:
        """Begin without a tick.

        Args:
            robot: of the live scene.
            quality: of the live scene.
        """
        self._scene = Scene(NodesThatExist(), robot, quality)  # pyright: ignore[reportArgumentType]  # it makes none
        self._plotted = PlottedTime()
        self._shown: tuple[Snapshot, Parameters, World] | None = None
        self._before: Sequence[Snapshot] | None = None
        self._frame = 0

    def show(self, snapshot: Snapshot, parameters: Parameters, world: World) -> None:
        """Show a tick from the next frame on; may be called from any thread.

        Args:
            snapshot: of the tick.
            parameters: in force at it.
            world: that the robot walked in.
        """
        self._shown = (snapshot, parameters, world)

    def leave(self) -> None:
        """Show the present again; may be called from any thread, in the middle of a frame, too."""
        self._shown = None

    def remember(self, before: Sequence[Snapshot]) -> None:
        """Draw footsteps, trails and plots of the time before the tick; may be called from any thread."""
        self._before = before

    def draw(self, elapsed: float, shown: Set[str], plots: PlotsTab) -> SceneUpdates | None:
        """The changes for this browser; None while it is shown the present.

        Args:
            elapsed: real time since the last call [s].
            shown: names of the layers of the live scene that are shown.
            plots: of the panel.
        """
        if (look := self._shown) is None:
            return None
        snapshot, parameters, world = look
        before, self._before = self._before, None
        if before is not None and before[-1].tick <= snapshot.tick:  # else it is for a tick shown before
            self._plotted.replace(before)
            self._scene.remember(before, parameters)
        self._scene.show_all_of(shown)
        self._scene.draw(snapshot, parameters, elapsed, world=world)
        self._plotted.record(snapshot, float("nan"))
        self._frame += 1
        if self._frame % FRAMES_PER_PLOT == 0:
            plots.show(self._scene.updates, self._plotted)
        return self._scene.updates
