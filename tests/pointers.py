"""Pointers on the page: a mouse and a finger that drag."""

from playwright.sync_api import Locator, Page


def centre(element: Locator) -> tuple[float, float]:
    box = element.bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


class Finger:
    """A touch that drags; Playwright itself only taps."""

    def __init__(self, page: Page) -> None:
        self._session = page.context.new_cdp_session(page)

    def _send(self, kind: str, *points: tuple[float, float]) -> None:
        touches = [{"x": x, "y": y} for x, y in points]
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touches})

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self._send("touchStart", start)
        self._send("touchMove", end)

    def lift(self) -> None:
        self._send("touchEnd")

    def tap_beside(self, held: tuple[float, float], point: tuple[float, float]) -> None:
        """Tap with a second finger, while this one is held."""
        self._send("touchStart", held, point)
        self._send("touchMove", held)


class Mouse:
    """A mouse that drags."""

    def __init__(self, page: Page) -> None:
        self._mouse = page.mouse

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self._mouse.move(*start)
        self._mouse.down()
        self._mouse.move(*end, steps=4)

    def lift(self) -> None:
        self._mouse.up()
