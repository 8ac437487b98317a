"""Routes of the lease to drive alone: it is taken, handed over, and given up."""

from typing import Annotated

from fastapi import APIRouter, Query

from app.http.schemas import ErrorBody, LeaseBody, LeaseRequest
from app.live.driver_lease import DriverLease
from app.routes.dependencies import Lease

HELD = {409: {"model": ErrorBody, "description": "Another browser drives alone."}}

router = APIRouter(prefix="/api/v1/live/lease", tags=["live"], responses={422: {"model": ErrorBody}})


@router.get("")
async def lease(lease: Lease) -> LeaseBody:
    """Which browser drives alone, and which there are."""
    return _body(lease)


@router.put("", responses={**HELD})
async def give(body: LeaseRequest, lease: Lease) -> LeaseBody:
    """Let one browser drive alone: one's own, or another to which a holder hands over.

    Others' references are refused until it gives up, or has sent no command for 30 s. Anybody may stop the robot.
    """
    lease.give(body.client, body.by)
    return _body(lease)


@router.delete("", responses={**HELD})
async def end(lease: Lease, by: Annotated[str, Query(max_length=64)] = "") -> LeaseBody:
    """Let everybody drive again."""
    lease.end(by)
    return _body(lease)


def _body(lease: DriverLease) -> LeaseBody:
    return LeaseBody(holder=lease.holder, expires_in=lease.expires_in, clients=lease.clients)
