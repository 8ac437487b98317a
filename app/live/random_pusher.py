"""Pushes that come by themselves, drawn at random."""

import math

import numpy as np

from app.live.live_state import RandomPushes
from walkcore import Push


class RandomPusher:
    """Draws when the next random push comes, from where and how strong."""

    def __init__(self, pushes: RandomPushes, period: float) -> None:
        """Let the first push come after about one interval.

        Args:
            pushes: how strong and how often.
            period: from one tick to the next [s].
        """
        self._pushes, self._period = pushes, period
        self._random = np.random.default_rng(pushes.seed)
        self._ticks_left = self._draw_wait()

    def at_next_tick(self) -> Push | None:
        """The push that begins at the next tick, if one does."""
        self._ticks_left -= 1
        if self._ticks_left > 0:
            return None
        self._ticks_left = self._draw_wait()
        angle = self._random.uniform(-math.pi, math.pi)
        strength = self._pushes.strength * self._random.uniform(0.5, 1.0)
        return Push(strength * np.array([math.cos(angle), math.sin(angle)]))

    def _draw_wait(self) -> int:
        return max(1, round(self._pushes.interval * self._random.uniform(0.5, 1.5) / self._period))
