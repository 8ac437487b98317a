"""What a drawn frame costs: all that viser's thread does from one frame to the next, in processor time."""

import time

SMOOTHING = 0.02  # weight of the latest frame in the mean


class FrameCost:
    """Counts frames that somebody looks at. Belongs to viser's thread; anyone may read."""

    def __init__(self) -> None:
        """Begin with none."""
        self.count = 0
        self.seconds = 0.0
        """Of all of them."""
        self.mean_ms = 0.0
        """Of the latest second or two [ms]."""
        self._since = 0.0

    def skip(self) -> None:
        """What was done since the last call, if ever there was one, counts for no frame."""
        self._since = time.thread_time()

    def add(self) -> None:
        """A frame was drawn and sent."""
        now = time.thread_time()
        spent, self._since = now - self._since, now
        self.count += 1
        self.seconds += spent
        self.mean_ms += max(SMOOTHING, 1.0 / self.count) * (1e3 * spent - self.mean_ms)
