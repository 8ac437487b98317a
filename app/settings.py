"""What may be set from outside. The only reader of the environment."""

from typing import Literal

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict


class Settings(BaseSettings):
    """Each field is an environment variable of the same name in capitals: HOST, PORT, ROBOT, SCENE."""

    model_config = SettingsConfigDict(extra="ignore")

    host: str = "127.0.0.1"
    """Address to listen on; the loopback unless told otherwise."""
    port: int = Field(default=8000, ge=0, le=65535)
    """Port to listen on; 0 takes a free one."""
    robot: str = "talos"
    """Robot that walks on the page."""
    scene: Literal["full", "light"] = "full"
    """Light, with coarser meshes and no shadows, where browsers render without a graphics card."""
