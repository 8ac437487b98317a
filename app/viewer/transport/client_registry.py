"""Registry of the connected browsers, by what a page says of itself in the address of its scene's websocket."""

from urllib.parse import parse_qs, urlsplit

import viser

from app.viewer.transport.viser_private import requested_path

LIGHT_PATH = "/light"
"""Path of the websocket of browsers that render in software."""


class ClientRegistry:
    """Path of each client's websocket, and the page that its scene belongs to."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Register the clients that connect from now on."""
        self._pages: dict[int, str] = {}
        self._server = server

        @server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            query = urlsplit(requested_path(server, client.client_id)).query
            self._pages[client.client_id] = parse_qs(query).get("client", [""])[0]

        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            self._pages.pop(client.client_id, None)

    def is_light(self, client: viser.ClientHandle) -> bool:
        """Whether a client renders in software and is to be sent a scene without shadows."""
        return urlsplit(requested_path(self._server, client.client_id)).path == LIGHT_PATH

    def page(self, client_id: int) -> str:
        """Id of the page that a client's scene belongs to, as its controls send it; "" for a scene without a page."""
        return self._pages.get(client_id, "")

    def scenes(self, page: str) -> list[int]:
        """Ids of the clients that are scenes of a page."""
        return [client for client, of in self._pages.items() if of == page]

    def is_open(self, page: str) -> bool:
        """Whether the scene of a page is still open."""
        return page in self._pages.values()
