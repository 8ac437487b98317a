"""A booth in use: its screen leads phones to a stick and a push, one after the other."""

import io
import json
import math
import socket
import struct
from typing import Any
from urllib.parse import parse_qs, quote, urlsplit

import httpx
import numpy as np
import pytest
import segno
import zxingcpp
from axe_playwright_python.sync_playwright import Axe
from conftest import PATIENCE, PHONE, Server, bearer, serving, wait_for
from PIL import Image, ImageFilter
from playwright.sync_api import expect
from pointers import Mouse, centre
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from app.live.booth import PUSH_SHARE
from walkcore import load_robot

pytestmark = pytest.mark.server("hrp2")


def test_a_code_holds_the_link_that_lets_a_phone_drive_for_addresses_of_servers_only(api):
    link = f"http://10.0.0.7:8000{api.get('live/booth').json()['phone']}"
    picture = api.get("live/booth/code.svg", params={"address": "http://10.0.0.7:8000/anything"})
    assert picture.headers["content-type"] == "image/svg+xml" and "no-store" in picture.headers["cache-control"]
    expected = io.BytesIO()
    segno.make_qr(link, error="m").save(expected, kind="svg", border=2, light="#fff", xmldecl=False, omitsize=True)
    assert picture.content == expected.getvalue()
    for address in ("javascript:alert(1)", "10.0.0.7", "ftp://a", ""):
        assert api.get("live/booth/code.svg", params={"address": address}).status_code == 422


def phone(server: Server, api: httpx.Client, client: str) -> ClientConnection:
    key = parse_qs(urlsplit(api.get("live/booth").json()["phone"]).query)["key"][0]
    return connect(server.socket_url(f"booth/phone?key={key}&client={client}"))


def told(socket: ClientConnection, **expected: Any) -> dict:
    """The first message of the server that says all of this."""
    while True:
        message = json.loads(socket.recv(timeout=PATIENCE))
        if all(message[name] == value for name, value in expected.items()):
            return message


def test_a_phone_drives_the_next_one_waits_and_nobody_stays_when_the_screen_goes(server, api):
    with connect(server.socket_url("booth/screen")) as screen, phone(server, api, "a") as a:
        told(a, is_open=True, place=0)
        with phone(server, api, "b") as b:
            assert told(b, place=1)["own_number"] == told(screen, waiting=1)["number"] + 1
            a.send(json.dumps({"forward": 1.0}))
            wait_for(lambda: api.get("live").json()["driver_client"] == "a")
            assert api.put("live/reference", json={"vx": 0.1}).status_code == 409
            b.send(json.dumps({"forward": -1.0}))
            b.send(json.dumps({"push": 0.0}))
            a.send(json.dumps({"forward": 2.0}))
            wait_for(lambda: "forward" in told(a, place=0)["error"])
            a.send(json.dumps({"push": 0.5 * math.pi}))
            wait_for(lambda: api.get("live").json()["last_push"] is not None)
            impulse = api.get("live").json()["last_push"]["impulse"]
            assert impulse == pytest.approx([0.0, PUSH_SHARE * load_robot("hrp2").max_push], abs=1e-6)
        screen.close()
        told(a, is_open=False, place=None)
        a.send(json.dumps({"again": True}))
        told(a, is_open=False, place=None)
        assert api.put("live/reference", json={}).status_code == 200


@pytest.mark.exhaustive
def test_a_phone_whose_messages_wait_while_it_goes_leaves_no_trace_in_the_log(server, api):
    with connect(server.socket_url("booth/screen")), phone(server, api, "gone") as gone:
        told(gone, place=0)
        for _ in range(200):  # which are read for some seconds more
            gone.send(json.dumps({"forward": 0.5}))
        gone.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        gone.socket.close()
        wait_for(lambda: api.get("live").json()["driver_client"] == "" and not api.get("live/booth").json()["number"])
    assert "Traceback" not in "".join(server.output)


def test_without_the_key_of_today_nobody_drives(server):
    for key in ("", "wrong", "\u00e4"):
        with pytest.raises((InvalidStatus, ConnectionClosed)):
            connect(server.socket_url(f"booth/phone?key={quote(key)}")).recv(timeout=PATIENCE)


def test_with_tokens_a_phone_needs_the_key_only_and_a_screen_the_operators(tmp_path):
    with serving("--robot", "hrp2", "--scene", "light", WALK_TOKEN="one", WALK_VIEW_TOKEN="two") as server:
        assert httpx.get(f"{server.url}phone").status_code == 200
        for path in ("api/v1/live/booth", "api/v1/live/booth/code.svg?address=http://a", "?booth", "static/main.js"):
            assert httpx.get(f"{server.url}{path}").status_code in (303, 401), path
        assert httpx.get(f"{server.url}static/phone.js").status_code == 200
        for token in ("", "two"):
            with pytest.raises((InvalidStatus, ConnectionClosed)):
                connect(server.socket_url("booth/screen"), additional_headers=bearer(token)).recv(timeout=PATIENCE)
        with server.client(bearer("one")) as api:
            with connect(server.socket_url("booth/screen"), additional_headers=bearer("one")):
                with phone(server, api, "a") as a:
                    told(a, is_open=True, place=0)
                    a.send(json.dumps({"turn": 1.0, "left": 1.0}))
                    wait_for(lambda: api.get("live").json()["driver_client"] == "a")


SIZES = [(320, 480), (320, 568), (390, 844), (568, 320), (844, 390), (820, 1180), (1180, 820)]
OUTSIDE = """() => [...document.querySelectorAll("h1, #more, .joystick, .turn, #push, #again, .turn-left")]
  .filter((e) => e.checkVisibility())
  .filter((e) => { const b = e.getBoundingClientRect();
    const hit = document.elementFromPoint((b.left + b.right) / 2, (b.top + b.bottom) / 2);
    return b.left < 0 || b.top < 0 || b.right > innerWidth || b.bottom > innerHeight || !e.contains(hit); })
  .map((e) => e.id || e.className)"""


@pytest.mark.exhaustive
def test_the_screen_leads_phones_to_a_stick_and_a_push_one_after_the_other(visit, api, server):
    screen = visit(f"{server.url}?booth=http://10.0.0.7:8000", viewport={"width": 1920, "height": 1080})
    expect(screen.locator("#booth-state")).to_contain_text("by itself")
    wait_for(lambda: screen.evaluate("document.getElementById('booth-code').naturalWidth > 0"))
    for hidden in (".tools", ".drive", ".push", ".dock", "#notices"):
        expect(screen.locator(hidden)).to_be_hidden()
    link = server.url + api.get("live/booth").json()["phone"].removeprefix("/")
    first = visit(link, **PHONE)
    expect(first.locator("#place")).to_have_text("You drive!")
    second = visit(link, **PHONE)
    expect(second.locator("#place")).to_have_text("You are next")
    expect(screen.locator("#booth-state")).to_contain_text("drives, 1 waiting")
    expect(first.locator("#more")).to_contain_text("1 waiting")
    mouse, (x, y) = Mouse(first), centre(first.locator("#joystick"))
    mouse.drag((x, y), (x, y - 60))
    wait_for(lambda: api.get("live").json()["reference_vx"] > 0.0)
    assert api.get("live").json()["driver"] == "phone"
    mouse.lift()
    wait_for(lambda: api.get("live").json()["reference_vx"] == 0.0)
    first.locator("#push").click()
    wait_for(lambda: api.get("live").json()["last_push"] is not None)
    for page in (first, second):
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            assert page.evaluate(OUTSIDE) == [] or page is second, (width, height)
            assert page.evaluate("document.documentElement.scrollHeight <= innerHeight"), (width, height)
    assert Axe().run(first).response["violations"] == []
    assert second.locator("#controls").evaluate("(e) => e.inert")
    assert Axe().run(screen).response["violations"] == []
    first.close()
    expect(second.locator("#place")).to_have_text("You drive!")
    screen.close()
    expect(second.locator("#place")).to_have_text("The booth is closed")


def as_a_camera_sees(picture: Image.Image) -> Image.Image:
    """A screen from the side, by a camera of few pixels that is held askew by 20 degrees and out of focus."""
    width, height = 1280, 720
    corners = np.array([[160, 60], [1120, 130], [1120, 590], [160, 660]])  # of the screen in the photograph
    plane = np.array([[0, 0], [picture.width, 0], picture.size, [0, picture.height]])
    rows = [
        row
        for (x, y), (u, v) in zip(corners, plane, strict=True)
        for row in ([x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y])
    ]
    there = np.linalg.solve(np.array(rows, dtype=float), plane.ravel().astype(float))
    seen = picture.transform((width, height), Image.Transform.PERSPECTIVE, there.tolist(), Image.Resampling.BICUBIC)
    return seen.rotate(20.0, Image.Resampling.BICUBIC).filter(ImageFilter.GaussianBlur(1.5))


def codes(picture: Image.Image) -> list[str]:
    """Texts of the QR codes in a picture."""
    return [code.text for code in zxingcpp.read_barcodes(picture)]


def test_a_phone_that_scans_the_screen_from_the_side_comes_to_drive(visit, api, server):
    screen = visit(f"{server.url}?booth", viewport={"width": 1920, "height": 1080})
    expect(screen.locator("#booth-state")).not_to_have_text("connecting …")
    wait_for(lambda: screen.evaluate("document.getElementById('booth-code').naturalWidth > 0"))
    address = screen.url.removesuffix("/?booth") + api.get("live/booth").json()["phone"]
    for width, height in ((1920, 1080), (1280, 720)):
        for colours in ("light", "dark"):
            screen.set_viewport_size({"width": width, "height": height})
            screen.emulate_media(color_scheme=colours)
            picture = Image.open(io.BytesIO(screen.screenshot())).convert("L")
            assert [codes(picture), codes(as_a_camera_sees(picture))] == [[address], [address]], (width, colours)
    scanned = visit(address, **PHONE)
    expect(scanned.locator("#place")).to_have_text("You drive!")
