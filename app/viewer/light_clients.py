"""Clients that render in software are spared the shadows; each asks for it by the path of its websocket."""

import viser

from app.viewer.scene import add_key_light

LIGHT_PATH = "/light"


def spare_light_clients(server: viser.ViserServer) -> None:
    """Give each client that comes by `LIGHT_PATH` a sun without shadows in the place of the one for all."""

    @server.on_client_connect
    def _(client: viser.ClientHandle) -> None:
        connection = server._websock_server._live_connections.get(client.client_id)
        if connection is not None and connection.request is not None and connection.request.path == LIGHT_PATH:
            add_key_light(client.scene, has_shadows=False)
