"""Settings from outside: the only reader of the environment and of the size of the machine.

Whatever starts a process imports this before numpy: the algebra library reads the number of its threads when it loads.
"""

import os
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, SecretStr, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

# The matrices of the walk are small: threads of the algebra library only fight with each other over them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def process_environment() -> dict[str, str]:
    """The environment of a process that is started from here."""
    return dict(os.environ)


def usable_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0))


def _default_robot() -> str:
    from walkcore.robot_file import DEFAULT_ROBOT  # loads numpy, which comes after the line above

    return DEFAULT_ROBOT


class Settings(BaseSettings):
    """Settings of the server: each field is an environment variable of the same name in capitals (HOST, RUNS_KEPT)."""

    model_config = SettingsConfigDict(extra="ignore")

    host: str = "127.0.0.1"
    """Address to listen on; the loopback by default."""
    port: int = Field(default=8000, ge=0, le=65535)
    """Port to listen on; 0 takes a free one."""
    robot: str = Field(default_factory=_default_robot)
    """Robot that walks on the page: the name of one that ships, or the path of a robot file."""
    walk_robots: Path | None = None
    """Folder of further robot files, each named as its robot, that pages and clients may choose."""
    walk_plant: Literal["auto", "ideal", "mujoco"] = "auto"
    """Plant that the joints move at the start: auto takes contact physics where this machine keeps up with it."""
    scene: Literal["full", "light"] = "full"
    """Detail of the scene: light has coarser meshes and no shadows, for browsers without a graphics card."""
    walk_lessons: Path | None = None
    """Folder of further lessons (`NAME.md`); one with the name of a shipped one takes its place."""
    walk_token: SecretStr = SecretStr("")
    """Token that page, sockets and API require; empty requires none."""
    walk_view_token: SecretStr = SecretStr("")
    """Token of those who may only look; empty for none. It takes a `walk_token` beside it."""
    spectators: int = Field(default=40, ge=1, le=500)
    """Scenes that may be open at once; with tokens, operators come on top."""
    walk_hosts: str = ""
    """Further names by which the server is reached, with commas between them; `*` takes any."""
    exit_unhealthy_after: float = Field(default=0.0, ge=0.0)
    """Time after which a server that is not healthy ends itself, to be started again [s]; 0 for never."""
    walk_data: Path = Path("~/.local/share/walk")
    """Folder where runs are kept; each server needs its own."""
    runs_workers: int = Field(default_factory=lambda: max(1, usable_cores() - 1), ge=1, le=256)
    """Runs that are simulated at once; by default a core is left to the live walk."""
    runs_queued: int = Field(default=64, ge=1)
    """Runs that may wait."""
    runs_kept: int = Field(default=200, ge=1)
    """Ended runs that are kept; the oldest go first."""
    runs_bytes: int = Field(default=2_000_000_000, ge=0)
    """Total size of the files of all runs [bytes]; the oldest runs go first, the latest never."""
    runs_max_duration: float = Field(default=600.0, gt=0.0, le=3600.0)
    """Longest run [s]."""
    runs_max_ticks: int = Field(default=120_000, ge=1)
    """Most ticks of one run."""
    runs_max_events: int = Field(default=1000, ge=0)
    """Most events of one run."""
    uploads_max_bytes: int = Field(default=100_000_000, ge=1)
    """Size of the largest recording that may be uploaded [bytes]."""
    sweeps_queued: int = Field(default=8, ge=1)
    """Sweeps that may wait; one is walked at a time."""
    sweeps_kept: int = Field(default=50, ge=1)
    """Ended sweeps that are kept; the oldest go first."""
    sweeps_max_ticks: int = Field(default=20_000_000, ge=1)
    """Most ticks of all trials of one sweep."""

    @model_validator(mode="after")
    def _has_two_tokens(self) -> Self:
        operator, viewer = self.walk_token.get_secret_value(), self.walk_view_token.get_secret_value()
        if viewer and viewer == operator:
            raise ValueError("WALK_VIEW_TOKEN must differ from WALK_TOKEN")
        if viewer and not operator:
            raise ValueError("WALK_VIEW_TOKEN needs a WALK_TOKEN beside it: without one everybody may do everything")
        return self
