"""Token authentication: with WALK_TOKEN set, nothing is shown and no command taken without it."""

import re
from collections.abc import Iterator

import httpx
import pytest
from conftest import UP, Server, serving
from playwright.sync_api import expect
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

TOKEN = "correct horse, bättery staple"
BEARER = {"Authorization": f"Bearer {TOKEN}".encode()}


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with serving("--robot", "hrp2", "--scene", "light", WALK_TOKEN=TOKEN) as server:
        yield server
    assert "horse" not in "".join(server.output)


@pytest.fixture
def client(server) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=server.url) as client:
        yield client


def sign_in(client: httpx.Client, token: str = TOKEN, **fields: str) -> httpx.Response:
    return client.post("signin", data={"token": token} | fields)


EVERYTHING = [
    "",
    "viewer/",
    "docs",
    "openapi.json",
    "static/main.js",
    "api/v1/live",
    "api/v1/runs",
    "nowhere",
    "metrics",
]


@pytest.mark.parametrize("path", EVERYTHING)
@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Authorization": "Bearer wrong"},
        {"Authorization": f"Basic {TOKEN}".encode()},
        {"Authorization": b"Bearer \xff\xfe"},
        {"Authorization": "Bearer"},
        {"Cookie": "walk=1; walk-00000000=x; ==;,"},
        {"Cookie": f"walk-00000000={TOKEN}".encode()},
    ],
)
def test_nothing_is_shown_without_the_token(client, path, headers):
    response = client.get(path, headers=headers)
    assert response.status_code == 401 and response.headers["www-authenticate"] == "Bearer"
    assert set(response.json()) == {"detail", "errors"}


@pytest.mark.parametrize("method", ["PUT", "POST", "PATCH", "DELETE", "HEAD", "OPTIONS"])
def test_no_command_is_taken_without_the_token(client, method):
    assert client.request(method, "api/v1/live/reference", json={"vx": 0.1}).status_code == 401


@pytest.mark.parametrize("path", ["api/v1/live/stream", "api/v1/live/teleop", "viewer"])
def test_no_socket_opens_without_the_token(server, path):
    with pytest.raises(InvalidStatus) as refusal, connect(f"ws://{server.host}/{path}"):
        pass
    assert refusal.value.response.status_code == 403
    if path != "viewer":  # which speaks viser's subprotocol only
        with connect(f"ws://{server.host}/{path}", additional_headers={"Authorization": f"Bearer {TOKEN}"}):
            pass


def test_health_is_open_for_health_checks(client):
    assert client.get("api/v1/health").status_code == 200


def test_programs_show_the_token_as_a_bearer(client):
    assert client.get("api/v1/live", headers=BEARER).status_code == 200
    assert client.put("api/v1/live/reference", json={"vx": 0.0}, headers=BEARER).status_code == 200
    assert client.get("docs", headers=BEARER).status_code == 200


def test_a_browser_gets_a_cookie_that_scripts_cannot_read_and_that_is_not_the_token(client):
    response = sign_in(client)
    assert response.status_code == 303 and response.headers["location"] == "/"
    cookie = response.headers["set-cookie"]
    assert "HttpOnly" in cookie and "SameSite=lax" in cookie and "Secure" not in cookie
    assert "horse" not in cookie
    for path in ("", "viewer/", "static/main.js", "api/v1/live"):
        assert client.get(path).status_code == 200
    with connect(f"ws://{client.base_url.netloc.decode()}/api/v1/live/stream", additional_headers={"Cookie": cookie}):
        pass


def test_a_wrong_token_gets_no_cookie(client):
    for token in ("", "wrong", TOKEN + " ", "x" * 5000):
        response = sign_in(client, token)
        assert response.status_code == 303 and "set-cookie" not in response.headers
        assert response.headers["location"].startswith("/signin?wrong")
    assert client.get("").status_code == 401


@pytest.mark.parametrize(
    ("place", "leads_to"),
    [
        ("/docs", "/docs"),
        ("/?scheme=full", "/?scheme=full"),
        ("//elsewhere.example", "/"),
        ("/\\elsewhere.example", "/"),
        ("https://elsewhere.example", "/"),
        ("/a\r\nSet-Cookie: x=1", "/"),
    ],
)
def test_signing_in_leads_on_and_never_to_another_site(client, place, leads_to):
    assert sign_in(client, next=place).headers["location"] == leads_to


def test_behind_a_proxy_with_tls_the_cookie_is_for_tls_only(client):
    response = client.post("signin", data={"token": TOKEN}, headers={"X-Forwarded-Proto": "https"})
    assert "Secure" in response.headers["set-cookie"]


def test_a_person_is_shown_the_form_and_then_the_page(server, visit):
    page = visit(f"{server.url}?from=a-link#place")
    page.get_by_label("Token").fill("wrong")
    page.get_by_role("button", name="Sign in").click()
    page.wait_for_url(re.compile("wrong"))
    assert page.get_by_role("alert").inner_text() == "That is not the token."
    page.get_by_label("Token").fill(TOKEN)
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_test_id("status")).to_contain_text(UP)
    assert page.url == f"{server.url}?from=a-link#place"
    assert page.evaluate("document.cookie") == ""
