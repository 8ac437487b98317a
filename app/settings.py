"""What may be set from outside. The only reader of the environment and of the size of the machine."""

import os
from pathlib import Path
from typing import Literal

from pydantic import Field, SecretStr
from pydantic_settings import BaseSettings, SettingsConfigDict


def usable_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


class Settings(BaseSettings):
    """Each field is an environment variable of the same name in capitals: HOST, PORT, ROBOT, RUNS_KEPT, WALK_DATA."""

    model_config = SettingsConfigDict(extra="ignore")

    host: str = "127.0.0.1"
    """Address to listen on; the loopback unless told otherwise."""
    port: int = Field(default=8000, ge=0, le=65535)
    """Port to listen on; 0 takes a free one."""
    robot: str = "talos"
    """Robot that walks on the page."""
    scene: Literal["full", "light"] = "full"
    """Light, with coarser meshes and no shadows, where browsers render without a graphics card."""
    walk_token: SecretStr = SecretStr("")
    """Asked for by page, sockets and API; nothing is asked where it is empty."""
    walk_data: Path = Path("~/.local/share/walk")
    """Folder where runs are kept; one server each."""
    runs_workers: int = Field(default_factory=lambda: max(1, usable_cores() - 1), ge=1, le=256)
    """Runs that are simulated at once; by default a core is left to the live walk."""
    runs_queued: int = Field(default=64, ge=1)
    """Runs that may wait."""
    runs_kept: int = Field(default=200, ge=1)
    """Ended runs that are kept; the oldest go first."""
    runs_bytes: int = Field(default=2_000_000_000, ge=0)
    """Size of all their files; the oldest go first, the latest never."""
    runs_max_duration: float = Field(default=600.0, gt=0.0, le=3600.0)
    """Of one run [s]."""
    runs_max_ticks: int = Field(default=120_000, ge=1)
    """Of one run."""
    runs_max_events: int = Field(default=1000, ge=0)
    """Of one run."""
