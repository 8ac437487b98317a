"""What of the robot is drawn: the same for all who look."""

import asyncio

from fastapi import APIRouter
from pydantic import StrictBool

from app.http.schemas import ErrorBody
from app.routes.connection import LiveViewer
from app.viewer.panel.view_tab import DEFAULTS

router = APIRouter(prefix="/api/v1/live/layers", tags=["live"])


@router.get("")
async def layers(viewer: LiveViewer) -> dict[str, bool]:
    """Which layers of the scene are drawn."""
    return viewer.layers


@router.get("/defaults")
async def defaults() -> dict[str, bool]:
    """The layers that the server started with."""
    return DEFAULTS


@router.patch("", responses={422: {"model": ErrorBody}})
async def switch(values: dict[str, StrictBool], viewer: LiveViewer) -> dict[str, bool]:
    """Draw some layers or hide them; answers all of them."""
    return await asyncio.wrap_future(viewer.switch(values))
