"""Live plots: velocity against what was asked, centres of pressure against their bounds, computation of a tick."""

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray
from viser import uplot

from app.drawing.palette import CAPTURE, COM, COP_TRAIL, REFERENCE, SUPPORT, TRUE_COP, Colour
from app.live.runner import LiveState
from app.viewer.transport.stream import Stream
from walkcore import Robot, Snapshot
from walkcore.mpc.gait import Phase
from walkcore.mpc.stance import Footstep, sole_vertices
from walkcore.values import rotation

FRAMES_PER_POINT = 2
POINTS = 120  # eight seconds
HEIGHT = 128  # pixels

Columns = tuple[NDArray[np.float32], ...]


@dataclass(frozen=True, slots=True)
class Line:
    """A line of a plot."""

    label: str
    colour: Colour
    is_dashed: bool = False

    def series(self) -> uplot.Series:
        """As uPlot knows it."""
        dash = {"dash": (5.0, 4.0)} if self.is_dashed else {}
        stroke = "rgb({},{},{})".format(*self.colour)
        return uplot.Series(label=self.label, stroke=stroke, width=1.5, points={"show": False}, **dash)  # type: ignore[arg-type]


COP_LINES = (
    Line("CoP", COP_TRAIL),
    Line("true", TRUE_COP),
    Line("from", SUPPORT, is_dashed=True),
    Line("to", SUPPORT, is_dashed=True),
)
PLOTS = {
    "CoM velocity [m/s]": (
        Line("forward", COM),
        Line("asked", REFERENCE, is_dashed=True),
        Line("left", CAPTURE),
        Line("asked", REFERENCE, is_dashed=True),
    ),
    "CoP forward of the support foot [m]": COP_LINES,
    "CoP left of the support foot [m]": COP_LINES,
    "tick [ms]": (Line("mean", COM),),
}


class PlotsTab:
    """The last seconds. Points are taken at each drawn frame or so, and sent less often."""

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        """Make the plots, empty."""
        self._robot = robot
        self._frame, self._last_t = 0, -np.inf
        self._noted: list[LiveState] = []
        self._rows: deque[list[float]] = deque(maxlen=POINTS)
        self._plots: list[tuple[Any, int]] = []
        times = np.linspace(-1.0, 0.0, 2)
        for title, lines in PLOTS.items():
            plot = server.gui.add_uplot(
                (times, *[np.zeros(2)] * len(lines)),
                (uplot.Series(label="t"), *(line.series() for line in lines)),
                title=title,
                height=HEIGHT,
                scales={"x": uplot.Scale(time=False)},
                legend=uplot.Legend(show=True, live=False),
                padding=(8, 10, 0, 0),
            )
            self._plots.append((plot, len(lines)))

    def record(self, state: LiveState) -> None:
        """Take note of a state that is new."""
        t = state.snapshot.t
        if t < self._last_t:
            self._noted.clear()
            self._rows.clear()
        self._frame += 1
        if t == self._last_t or self._frame % FRAMES_PER_POINT:
            return
        self._last_t = t
        self._noted.append(state)

    def draw(self, stream: Stream) -> None:
        """Send the plots. What was noted is worked out here, several points at once: the first one costs the most."""
        for state in self._noted:
            snapshot = state.snapshot
            self._rows.append([snapshot.t, *_row(self._robot, snapshot), state.timing.tick_ms])
        self._noted.clear()
        if len(self._rows) < 2:
            return
        columns = np.array(self._rows, dtype=np.float32).T
        times, first = np.ascontiguousarray(columns[0]), 1
        for plot, count in self._plots:
            values: Columns = tuple(np.ascontiguousarray(column) for column in columns[first : first + count])
            stream.control(plot._impl.uuid, data=(times, *values))
            first += count


def _row(robot: Robot, snapshot: Snapshot) -> list[float]:
    """The values of all plots but the last one, in their order."""
    asked, foot = snapshot.reference, snapshot.support
    forward, left = (snapshot.com.velocity @ rotation(snapshot.heading)).tolist()
    feet = [foot]
    if snapshot.phase is not Phase.SINGLE_SUPPORT:
        feet = [Footstep(side, state.position, state.yaw) for side, state in snapshot.feet.items()]
    true_cop = snapshot.cop if snapshot.true_cop is None else snapshot.true_cop
    places = [snapshot.cop, true_cop, *(sole_vertices(robot.sole, each) for each in feet)]
    cop, true_cop, *corners = ((np.vstack(places) - foot.position) @ rotation(foot.yaw)).tolist()
    along = [(cop[i], true_cop[i], min(each := [corner[i] for corner in corners]), max(each)) for i in range(2)]
    return [forward, asked.vx, left, asked.vy, *along[0], *along[1]]
