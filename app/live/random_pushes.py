"""Pushes that come by themselves, the same ones for the same seed."""

import math

import numpy as np

from app.live.state import RandomPushes
from walkcore import Push


class RandomPusher:
    """Draws when the next push comes, from where and how strong."""

    def __init__(self, pushes: RandomPushes, period: float) -> None:
        """The first one comes after about an interval of ticks of `period` [s]."""
        self.pushes = pushes
        self._period = period
        self._random = np.random.default_rng(pushes.seed)
        self._ticks_left = self._wait()

    def _wait(self) -> int:
        return max(1, round(self.pushes.interval * self._random.uniform(0.5, 1.5) / self._period))

    def at_next_tick(self) -> Push | None:
        """The push that begins at the next tick, if one does."""
        self._ticks_left -= 1
        if self._ticks_left > 0:
            return None
        self._ticks_left = self._wait()
        angle = self._random.uniform(-math.pi, math.pi)
        strength = self.pushes.strength * self._random.uniform(0.5, 1.0)
        return Push(strength * np.array([math.cos(angle), math.sin(angle)]))
