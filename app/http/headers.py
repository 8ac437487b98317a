"""Headers of every response that tell browsers what our pages may load, and who may show them in a frame."""

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

# Style attributes are part of the pages; scripts are files of ours. `'self'` does not cover websockets in all browsers.
PAGE = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src 'self' {sockets}; "
    "object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'self'"
)
# viser's client is one file that unpacks itself, with its scripts, workers, fonts and WebAssembly.
SCENE = (
    "default-src 'self' data: blob:; script-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; "
    "style-src 'self' 'unsafe-inline'; connect-src 'self' data: blob: {sockets}; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
# The page of the REST interface starts its scripts, which are files of ours, by a line of its own.
DOCUMENTATION = PAGE + "; script-src 'self' 'unsafe-inline'"
POLICIES = {"/viewer/": SCENE, "/docs": DOCUMENTATION}
POLICY = "Content-Security-Policy"
FIXED = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "same-origin", "X-Frame-Options": "SAMEORIGIN"}


class SecurityHeadersMiddleware:
    """Adds the headers to every response that does not set them itself."""

    def __init__(self, app: ASGIApp) -> None:
        """Add to the responses of `app`."""
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, and add to what comes back."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        policy = _policy(scope["path"], Headers(scope=scope).get("host", ""))

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in {POLICY: policy, **FIXED}.items():
                    headers.setdefault(name, value)
            await send(message)

        await self._app(scope, receive, send_with_headers)


def _policy(path: str, host: str) -> str:
    """Content security policy of a path; `host` is known to be one of ours."""
    return POLICIES.get(path, PAGE).format(sockets=f"ws://{host} wss://{host}")
