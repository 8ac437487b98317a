"""Clients that render in software are spared the shadows; each asks for it by the path of its websocket."""

import viser

from app.viewer.scene.scene import add_key_light
from app.viewer.transport.visitors import address_of

LIGHT_PATH = "/light"


def spare_light_clients(server: viser.ViserServer) -> None:
    """Give each client that comes by `LIGHT_PATH` a sun without shadows in the place of the one for all."""

    @server.on_client_connect
    def _(client: viser.ClientHandle) -> None:
        if address_of(server, client).path == LIGHT_PATH:
            add_key_light(client.scene, has_shadows=False)
