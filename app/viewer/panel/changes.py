"""Changes that somebody types or chooses in a tab: numbers as text, and refusals shown to the client that asked."""

from concurrent.futures import Future, TimeoutError
from typing import Any

import viser

from app.live.messages import NoResponseError
from walkcore import WalkError

NOTICE = 8.0  # [s] for which a refusal is shown


def number_text(value: float) -> str:
    """A number as its field shows it."""
    return f"{value:g}"


def range_hint(description: str, limits: tuple[float, float]) -> str:
    """Hint of a number's field, by its description and its lowest and highest value."""
    low, high = limits
    return f"{description} From {low:g} to {high:g}."


def refuse(client: viser.ClientHandle, reason: str) -> None:
    """Tell a client why its change was not made."""
    client.add_notification("Not changed", reason, color="red", auto_close_seconds=NOTICE)


def is_made(client: viser.ClientHandle, response: Future[Any], timeout: float) -> bool:
    """Wait for a change; False, and the client is told, where it is refused or no response comes in time [s]."""
    try:
        response.result(timeout=timeout)
    except (WalkError, NoResponseError, TimeoutError) as refusal:
        refuse(client, str(refusal) or "the control process does not respond")
        return False
    return True
