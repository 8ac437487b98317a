"""Places for those who look: each open scene takes one, and costs the server what it sends there."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fastapi.responses import FileResponse
from starlette.requests import HTTPConnection

from app.http.token import role_of

RETRY_AFTER = 10  # [s]


class Seats:
    """Places for open scenes. Belongs to the event loop."""

    def __init__(self, nb_seats: int, has_roles: bool) -> None:
        """Start with all of them free.

        Args:
            nb_seats: scenes that may be open at once.
            has_roles: whether tokens tell operators from others; if so there is a place for each operator.
        """
        self._nb_seats, self._has_roles = nb_seats, has_roles
        self._nb_taken = 0

    def has_room(self, connection: HTTPConnection) -> bool:
        """Whether one more scene may be opened by whoever requests it."""
        return self._nb_taken < self._nb_seats or (self._has_roles and role_of(connection) == "operator")

    @contextmanager
    def taken(self) -> Iterator[None]:
        """Take a place while a scene is open."""
        self._nb_taken += 1
        try:
            yield
        finally:
            self._nb_taken -= 1


def full_page(page: Path) -> FileResponse:
    """The page for those who find no place; it tries again by itself."""
    headers = {"Retry-After": str(RETRY_AFTER), "Cache-Control": "no-store"}
    return FileResponse(page, status_code=503, headers=headers)
