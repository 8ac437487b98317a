"""Who looks: what a browser's page told of itself in the address of its websocket."""

from urllib.parse import SplitResult, parse_qs, urlsplit

import viser


def address_of(server: viser.ViserServer, client: viser.ClientHandle) -> SplitResult:
    """By which a client came; empty once it is gone."""
    connection = server._websock_server._live_connections.get(client.client_id)
    return urlsplit("" if connection is None or connection.request is None else connection.request.path)


class Visitors:
    """Which page each client's scene belongs to."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Keep the book from now on."""
        self._pages: dict[int, str] = {}

        @server.on_client_connect
        async def _(client: viser.ClientHandle) -> None:
            self._pages[client.client_id] = parse_qs(address_of(server, client).query).get("client", [""])[0]

        @server.on_client_disconnect
        async def _(client: viser.ClientHandle) -> None:
            self._pages.pop(client.client_id, None)

    def page(self, client: viser.ClientHandle) -> str:
        """What the page calls itself, as it does where it drives; empty for a scene without a page."""
        return self._pages.get(client.client_id, "")

    def is_here(self, page: str) -> bool:
        """Whether a page's scene is still open."""
        return page in self._pages.values()
