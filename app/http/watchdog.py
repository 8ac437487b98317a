"""Watchdog of the server: ends it when it has not been healthy for long, so that whoever runs it starts it again.

It asks for the health as anybody does, over the port, so that whatever keeps that from being answered counts.
"""

import logging
import os
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable

logger = logging.getLogger(__name__)

PERIOD = 2.0  # [s] between questions
PROBE_TIMEOUT = 10.0  # [s] an answer may take
EXIT_CODE = 70  # of the system's list: an error within the program


class Watchdog:
    """A thread that asks for the health."""

    def __init__(self, url: str, patience: float, end: Callable[[], object] = lambda: os._exit(EXIT_CODE)) -> None:
        """Ask nothing yet.

        Args:
            url: of the health.
            patience: time without a good answer after which the server ends [s].
            end: ends the server, at once: one that hangs would not clean up.
        """
        self._url, self._patience, self._end = url, patience, end
        self._is_stopping = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)

    def start(self) -> None:
        """Begin to ask."""
        self._thread.start()

    def stop(self) -> None:
        """Ask no more."""
        self._is_stopping.set()

    def _watch(self) -> None:
        last_good, problem = time.monotonic(), ""
        while not self._is_stopping.wait(min(PERIOD, self._patience / 4.0)):
            problem = _problem(self._url)
            now = time.monotonic()
            if not problem:
                last_good = now
            elif now - last_good > self._patience and not self._is_stopping.is_set():
                logger.critical("the server ends itself: not healthy for %.0f s (%s)", now - last_good, problem)
                self._end()
                return


def _problem(url: str) -> str:
    """The fault that an answer reports; empty if it reports none."""
    try:
        with urllib.request.urlopen(url, timeout=PROBE_TIMEOUT):
            return ""
    except (urllib.error.URLError, OSError) as error:
        return str(error)
