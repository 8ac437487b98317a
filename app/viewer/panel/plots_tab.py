"""Live plots: velocity against the reference, centres of pressure within their bounds, physics, time of a tick."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from viser import uplot

from app.drawing.palette import (
    COM,
    COP_TRAIL,
    DCM,
    GROUND_COP,
    LEFT_FOOT,
    REFERENCE,
    RIGHT_FOOT,
    SUPPORT,
    TRUE_COP,
    Colour,
)
from app.live.live_state import LiveState
from app.viewer.transport.scene_updates import SceneUpdates
from walkcore import Snapshot
from walkcore.mpc.stance import Side
from walkcore.values import Vector, rotation

FRAMES_PER_POINT = 2
POINTS = 120  # eight seconds
NOWHERE = np.full(2, np.nan)  # a point that there is not, which no plot draws
HEIGHT = 150  # pixels
TIME_AXIS = uplot.Axis(label="time [s]", size=26, labelSize=18, labelGap=2, gap=2)


@dataclass(frozen=True, slots=True)
class Line:
    """Line of a plot."""

    label: str
    colour: Colour
    is_dashed: bool = False
    may_be_absent: bool = False
    """Whether it is NaN in the ideal model, of which uPlot finds no range."""

    def series(self) -> uplot.Series:
        """Style of the line for uPlot."""
        stroke = "rgb({},{},{})".format(*self.colour)
        style: Any = {"points": {"show": False}, "auto": not self.may_be_absent}
        if self.is_dashed:
            style["dash"] = 5.0, 4.0
        return uplot.Series(label=self.label, stroke=stroke, width=1.5, **style)


COP_LINES = (
    Line("CoP", COP_TRAIL),
    Line("true", TRUE_COP),
    Line("contact", GROUND_COP, may_be_absent=True),
    Line("from", SUPPORT, is_dashed=True),
    Line("to", SUPPORT, is_dashed=True),
)


@dataclass(frozen=True, slots=True)
class Plot:
    """Lines over the time, and the range that is drawn at least: of a robot at rest the noise does not fill a plot."""

    lines: tuple[Line, ...]
    least: tuple[float, float]

    def scales(self) -> dict[str, uplot.Scale]:
        """Scales of both axes for uPlot."""
        low, high = ({"pad": 0.1, "soft": limit, "mode": 1} for limit in self.least)
        return {"x": uplot.Scale(time=False), "y": uplot.Scale(range={"min": low, "max": high})}


PLOTS = {
    "CoM velocity [m/s]": Plot(
        (
            Line("forward", COM),
            Line("its reference", COM, is_dashed=True),
            Line("left", REFERENCE),
            Line("its reference", REFERENCE, is_dashed=True),
        ),
        least=(-0.1, 0.1),
    ),
    "CoP forward of the support foot [m]": Plot(COP_LINES, least=(-0.1, 0.1)),
    "CoP left of the support foot [m]": Plot(COP_LINES, least=(-0.1, 0.1)),
    "DCM error, measured against model [m]": Plot((Line("forward", COM), Line("left", DCM)), least=(-0.01, 0.01)),
    "force on the soles [N]": Plot((Line("left", LEFT_FOOT), Line("right", RIGHT_FOOT)), least=(0.0, 100.0)),
    "tick [ms]": Plot((Line("mean", COM),), least=(0.0, 2.0)),
}


class PlottedTime:
    """Points of the last seconds before what is shown. They are recorded at every other drawn frame."""

    def __init__(self) -> None:
        """Begin without any."""
        self._frame, self._last_t = 0, -np.inf
        self._recorded: list[tuple[Snapshot, float]] = []
        self._rows: deque[list[float]] = deque(maxlen=POINTS)

    def record(self, snapshot: Snapshot, tick_ms: float) -> None:
        """Record a snapshot that is new.

        Args:
            snapshot: that is shown.
            tick_ms: mean time of a tick [ms].
        """
        if snapshot.t < self._last_t:
            self._recorded.clear()
            self._rows.clear()
        self._frame += 1
        if snapshot.t == self._last_t or self._frame % FRAMES_PER_POINT:
            return
        self._last_t = snapshot.t
        self._recorded.append((snapshot, tick_ms))

    def replace(self, snapshots: Sequence[Snapshot]) -> None:
        """Take these instead of what was recorded, in the order of time; their ticks took no time that is known."""
        self._rows.clear()
        self._recorded = [(snapshot, math.nan) for snapshot in snapshots]
        self._last_t = snapshots[-1].t if snapshots else -np.inf

    @property
    def columns(self) -> Sequence[Vector]:
        """Times, then the values of all lines; each of one length, none before there are two points."""
        # Points are computed here, several at once: the first one of a frame costs the most.
        for snapshot, tick_ms in self._recorded:
            self._rows.append([snapshot.t, *plotted(snapshot), tick_ms])
        self._recorded.clear()
        return [] if len(self._rows) < 2 else list(np.ascontiguousarray(np.array(self._rows, dtype=np.float32).T))


class PlotsTab:
    """Plots of the last seconds. Points are recorded at every other drawn frame, and sent less often."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Make the plots, empty."""
        self._live = PlottedTime()
        times = np.linspace(-1.0, 0.0, 2)
        self.plots = [
            server.gui.add_uplot(
                (times, *[np.zeros(2)] * len(plot.lines)),
                (uplot.Series(label="t"), *(line.series() for line in plot.lines)),
                title=title,
                height=HEIGHT,
                scales=plot.scales(),
                axes=(TIME_AXIS, uplot.Axis()),
                legend=uplot.Legend(show=True, live=False),
                padding=(8, 10, 0, 0),
            )
            for title, plot in PLOTS.items()
        ]
        """Plots in the order of `PLOTS`."""

    def record(self, state: LiveState) -> None:
        """Record a state that is new."""
        self._live.record(state.snapshot, state.timing.tick_ms)

    def update(self, updates: SceneUpdates) -> None:
        """Send the plots."""
        self.show(updates, self._live)

    def show(self, updates: SceneUpdates, time: PlottedTime) -> None:
        """Send the plots of some time to whom these updates go; those of contact physics are hidden without it."""
        columns = time.columns
        if not columns:
            return
        times, *values = columns
        first = 0
        for drawn, plot in zip(self.plots, PLOTS.values(), strict=True):
            lines = values[first : first + len(plot.lines)]
            is_there = not all(np.isnan(line).all() for line in lines)
            updates.control(drawn, data=(times, *lines), visible=is_there)
            first += len(plot.lines)


def plotted(snapshot: Snapshot) -> list[float]:
    """Values of all lines but the last plot's, in the order of `PLOTS`."""
    reference, foot = snapshot.reference, snapshot.support
    forward, left = (snapshot.com.velocity @ rotation(snapshot.heading)).tolist()
    plant = snapshot.plant
    true_cop = snapshot.cop if snapshot.true_cop is None else snapshot.true_cop
    contact = NOWHERE if plant is None or plant.contact.cop is None else plant.contact.cop
    places = np.vstack([snapshot.cop, true_cop, contact, snapshot.stance.polygon])
    cop, true_cop, contact, *corners = ((places - foot.position) @ rotation(foot.yaw)).tolist()
    values = [forward, reference.vx, left, reference.vy]
    for axis in range(2):
        bounds = [corner[axis] for corner in corners]
        values += [cop[axis], true_cop[axis], contact[axis], min(bounds), max(bounds)]
    if plant is None:
        return [*values, *4 * [np.nan]]
    forces = plant.contact.forces
    return [*values, *(plant.dcm_error @ rotation(snapshot.heading)).tolist(), forces[Side.LEFT], forces[Side.RIGHT]]
