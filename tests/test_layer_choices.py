"""Layers per browser: each switches its own, in its panel, by REST and by its link, and no other one sees it."""

from contextlib import ExitStack
from typing import Any

import pytest
from conftest import Server, wait_for
from scene_reader import CAMERA, SceneSocket

from app.viewer.scene.layers import DEFAULT_LAYERS, LAYERS

VELOCITY = LAYERS["velocity"].label

pytestmark = pytest.mark.server("hrp2")


class SceneOf:
    """Scene of a page, as its browser gets it."""

    def __init__(self, server: Server, page: str) -> None:
        address = f"ws://{server.host}/viewer?client={page}"
        self.socket = SceneSocket(address, origin=server.url.rstrip("/"))
        self.socket.send(CAMERA)
        self.visible: dict[str, bool] = {}
        self.boxes: dict[str, bool] = {}
        self.uuids: dict[str, str] = {}
        wait_for(lambda: self.see() and "/w/velocity" in self.visible and len(self.uuids) >= len(LAYERS))

    def see(self) -> bool:
        """Take in what came."""
        for message in self.socket.read():
            self._take(message)
        return True

    def _take(self, message: dict[str, Any]) -> None:
        if message["type"] == "GuiCheckboxMessage":
            self.uuids[message["props"]["label"]] = message["uuid"]
            self.boxes[message["uuid"]] = message["value"]
        elif message["type"] == "GuiUpdateMessage" and message["uuid"] in self.boxes:
            self.boxes[message["uuid"]] = message["updates"]["value"]
        elif "visible" in message:
            self.visible[message["name"]] = message["visible"]

    def switch(self, label: str, value: bool) -> None:
        self.socket.send({"type": "GuiUpdateMessage", "uuid": self.uuids[label], "updates": {"value": value}})

    def is_shown(self, layer: str) -> bool:
        """Whether its scene shows a layer and its switch says so."""
        return self.visible[f"/w/{layer}"] and self.boxes[self.uuids[LAYERS[layer].label]]


def test_a_switch_of_the_panel_is_for_its_own_browser(server, api):
    with ExitStack() as end:
        one, two = (SceneOf(server, page) for page in ("one", "two"))
        for scene in (one, two):
            end.enter_context(scene.socket)
        one.switch(VELOCITY, True)
        wait_for(lambda: one.see() and one.is_shown("velocity"))
        for page, is_shown in (("one", True), ("two", False)):
            assert api.get(f"live/layers?client={page}").json() == DEFAULT_LAYERS | {"velocity": is_shown}
        two.switch(VELOCITY, True)  # viser itself would not notice: the first browser set it already
        wait_for(lambda: two.see() and two.is_shown("velocity"))
        two.switch(VELOCITY, False)
        wait_for(lambda: two.see() and not two.visible["/w/velocity"])
        api.patch("live/layers?client=two", json={"robot": False}).raise_for_status()
        wait_for(lambda: two.see() and not two.visible["/w/robot"])
        for _ in range(5):
            one.see()
        assert one.is_shown("velocity") and one.visible.get("/w/robot", True)
        again = SceneOf(server, "one")  # as after a lost connection
        end.enter_context(again.socket)
        wait_for(lambda: again.is_shown("velocity") or not again.see())


def test_all_browsers_and_those_to_come_are_switched_without_a_name(server, api):
    scene = SceneOf(server, "three")
    with scene.socket:
        api.patch("live/layers", json={"margin": True}).raise_for_status()
        wait_for(lambda: scene.see() and scene.is_shown("margin"))
        for query in ("", "?client=three", "?client=four"):
            assert api.get(f"live/layers{query}").json()["margin"] is True
        assert api.get("live/layers/defaults").json() == DEFAULT_LAYERS
        api.patch("live/layers", json={"margin": False})
