"""Only known hosts are served, and what browsers are told about our pages."""

import re
import socket

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from playwright.sync_api import Browser, expect
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from app.http.hosts import KnownHosts

pytestmark = pytest.mark.server("hrp2", WALK_HOSTS="Walk.example, other.example")


LOCAL = ["localhost", "LocalHost:8000", "localhost.", "127.0.0.1", "127.1.2.3:1", "[::1]", "[::1]:8000", "[0:0::1]:1"]
FOREIGN = [
    "",
    "evil.example",
    "evil.example:8000",
    "localhost.evil.example",
    "evil.example.localhost@x",
    "evil@localhost",
    "localhost/",
    "localhost:port",
    "localhost:",
    "localhost, evil.example",
    " localhost",
    "192.168.1.20",
    "8.8.8.8:8000",
    "[2001:db8::1]",
    "::1",
    "[::1",
    "[localhost",
    "[::1%lo]",
    "0.0.0.0",
    "127.0.0.1.evil.example",
    "2130706433",
    "0x7f.0.0.1",
    "lôcalhost",
]


@pytest.mark.parametrize("host", LOCAL)
def test_the_loopback_is_known(host):
    assert KnownHosts("127.0.0.1").includes(host)


@pytest.mark.parametrize("host", FOREIGN)
def test_other_hosts_are_not_known(host):
    assert not KnownHosts("127.0.0.1").includes(host)
    assert not KnownHosts("127.0.0.1", ["", " "]).includes(host)


@pytest.mark.parametrize(
    ("bound_to", "known", "unknown"),
    [
        ("192.168.1.20", ["192.168.1.20:8000", "localhost"], ["192.168.1.21", "evil.example"]),
        ("0.0.0.0", ["192.168.1.20:8000", "[2001:db8::1]"], ["evil.example", "laptop.local"]),
        ("::", ["192.168.1.20:8000", "[2001:DB8::1]:80"], ["evil.example"]),
        ("2001:db8::1", ["[2001:DB8:0::1]:80"], ["[2001:db8::2]", "192.168.1.20"]),
        ("laptop.local", ["LAPTOP.local:8000"], ["evil.example"]),
    ],
)
def test_the_address_that_is_listened_on_is_known(bound_to, known, unknown):
    hosts = KnownHosts(bound_to)
    assert [host for host in known + unknown if hosts.includes(host)] == known


def test_names_are_known_that_were_told_and_all_by_a_star():
    hosts = KnownHosts("127.0.0.1", ["Walk.Example", " 10.0.0.7"])
    assert hosts.includes("walk.example:443") and hosts.includes("WALK.EXAMPLE.") and hosts.includes("10.0.0.7")
    assert not hosts.includes("www.walk.example")
    assert KnownHosts("127.0.0.1", ["*"]).includes("evil.example") and not KnownHosts("127.0.0.1", ["*"]).includes("")


@given(st.text(max_size=40))
def test_no_text_is_a_known_host_but_the_loopback(text):
    if KnownHosts("127.0.0.1").includes(text):
        name = text.lower().rpartition(":")[0] if text.rpartition(":")[2].isdecimal() and "]" not in text else text
        assert name.lower().rstrip(".") == "localhost" or text.startswith(("127.", "[", "localhost", "LOCALHOST"))


@pytest.mark.parametrize("path", ["", "viewer/", "docs", "static/main.js", "api/v1/health", "api/v1/live", "metrics"])
def test_a_foreign_host_is_served_nothing(server, path):
    assert httpx.get(server.url + path, headers={"Host": "evil.example:8000"}).status_code == 421
    assert httpx.get(server.url + path, headers={"Host": "WALK.example"}).status_code == 200


def test_a_page_that_rebinds_its_name_cannot_drive(server):
    headers = {"Host": "evil.example", "Origin": "http://evil.example"}
    assert httpx.put(f"{server.url}api/v1/live/reference", json={}, headers=headers).status_code == 421
    for path in ("api/v1/live/teleop", "api/v1/live/stream", "viewer"):
        with socket.create_connection(server.host.split(":")) as end:  # pyright: ignore[reportArgumentType]
            with pytest.raises(InvalidStatus) as refusal, connect(f"ws://evil.example/{path}", sock=end):
                pass
        assert refusal.value.response.status_code == 403


@pytest.mark.parametrize("host", ["Host: \r\n", "", "Host: localhost\r\nHost: evil.example\r\n"])
def test_a_request_without_exactly_one_host_is_refused(server, host):
    name, _, port = server.host.partition(":")
    with socket.create_connection((name, int(port))) as end:
        end.sendall(f"GET /api/v1/live HTTP/1.1\r\n{host}Connection: close\r\n\r\n".encode())
        assert end.makefile("rb").readline().split()[1] in (b"400", b"421")


@pytest.mark.parametrize("path", ["", "viewer/", "docs", "api/v1/health", "nowhere", "static/main.js"])
def test_no_other_site_may_show_our_pages_in_a_frame(server, path):
    headers = httpx.get(server.url + path).headers
    assert "frame-ancestors 'self'" in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"


def test_the_page_runs_no_script_that_is_not_a_file_of_ours(server):
    policy = httpx.get(server.url).headers["content-security-policy"]
    assert "default-src 'self';" in policy and "script-src" not in policy


def test_the_documentation_loads_nothing_from_elsewhere(server):
    page = httpx.get(f"{server.url}docs").text
    found = re.findall(r"""(?:src|href)=["']([^"']+)""", page)
    assert len(found) >= 3 and all(address.startswith("/") and not address.startswith("//") for address in found)
    for address in found:
        assert httpx.get(f"{server.url}{address[1:]}").status_code == 200


def test_the_documentation_is_drawn_by_its_own_files(server, browser: Browser):
    page = browser.new_page()
    elsewhere: list[str] = []
    page.on("request", lambda request: elsewhere.append(request.url) if server.host not in request.url else None)
    page.goto(f"{server.url}docs")
    expect(page.get_by_text("/api/v1/live/push")).to_be_visible()
    assert [address for address in elsewhere if not address.startswith(("data:", "blob:"))] == []
    page.close()
