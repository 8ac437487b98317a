"""A booth: phones drive in turn within bounds, and the robot looks after itself while nobody drives."""

import io
import json
import math
import socket
import struct
from collections.abc import Iterator
from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any
from urllib.parse import parse_qs, quote, urlsplit

import httpx
import numpy as np
import pytest
import segno
import zxingcpp
from axe_playwright_python.sync_playwright import Axe
from conftest import PATIENCE, PHONE, Server, serving, wait_for
from PIL import Image, ImageFilter
from playwright.sync_api import expect
from pointers import Mouse, centre
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from app.live.booth import ATTRACT_AFTER, ATTRACT_PUSH_SHARE, FAR, PUSH_PERIOD, PUSH_SHARE, ROUND, STAND_UP_AFTER, Booth
from app.live.driver_lease import DriverLease, LeaseHeldError
from app.live.driver_queue import (
    ABSENCE_TIMEOUT,
    IDLE_TIMEOUT,
    LEASE,
    MAX_WAITING,
    RECONNECT_TIMEOUT,
    TURN,
    DriverQueue,
    NotYourTurnError,
    QueueFullError,
)
from walkcore import Reference, load_robot
from walkcore.mpc.plan import Status

pytestmark = pytest.mark.server("hrp2")


@pytest.fixture
def lease(clock) -> DriverLease:
    return DriverLease(clock)


@pytest.fixture
def queue(lease, clock) -> DriverQueue:
    return DriverQueue(lease, clock)


def passes(time: float, clock, queue: DriverQueue, commanding: str = "") -> None:
    """Let time pass in small steps, in which one visitor may command."""
    for _ in range(round(time / 0.5)):
        clock.now += 0.5
        queue.update()
        if commanding and queue.driver == commanding:
            queue.check(commanding)


def test_a_turn_ends_where_others_wait_and_goes_on_where_nobody_does(queue, clock):
    queue.join("a")
    passes(1.5 * TURN, clock, queue, "a")
    assert queue.driver == "a" and queue.time_left == pytest.approx(0.5 * TURN)
    queue.join("b")
    assert (queue.place("a"), queue.place("b"), queue.nb_waiting) == (0, 1, 1)
    passes(0.5 * TURN, clock, queue, "a")
    assert queue.driver == "b" and queue.time_left == TURN
    assert queue.place("a") is None
    queue.join("a")
    assert queue.place("a") == 1


def test_only_the_one_whose_turn_it_is_commands_and_holds_the_lease(queue, lease):
    queue.update()
    assert lease.holder == ""
    queue.join("a")
    queue.join("b")
    queue.update()
    queue.check("a")
    for name in ("b", "c", ""):
        with pytest.raises(NotYourTurnError):
            queue.check(name)
    with pytest.raises(LeaseHeldError):
        lease.check("a browser")
    queue.clear()
    lease.check("a browser")
    with pytest.raises(NotYourTurnError):
        queue.check("a")


def test_a_browser_that_drives_alone_keeps_visitors_waiting_and_keeps_its_lease(queue, lease):
    lease.give("a browser", "a browser")
    queue.join("a")
    with pytest.raises(LeaseHeldError):
        queue.update()
    with pytest.raises(LeaseHeldError):
        queue.check("a")
    lease.end("a browser")
    queue.update()
    queue.check("a")
    assert lease.holder == LEASE


def test_an_idle_driver_makes_room_for_one_that_waits_and_leaves_in_the_end(queue, clock):
    queue.join("a")
    passes(IDLE_TIMEOUT + 5.0, clock, queue)
    assert queue.driver == "a"
    queue.join("b")
    passes(1.0, clock, queue)
    assert queue.driver == "b"
    passes(ABSENCE_TIMEOUT - 1.0, clock, queue)
    assert queue.driver == "b"
    passes(2.0, clock, queue)
    assert queue.driver == "" and queue.time_left == 0.0


def test_a_lost_connection_costs_the_place_only_where_it_lasts(queue, clock):
    queue.join("a")
    queue.join("b")
    queue.disconnect("a")
    passes(RECONNECT_TIMEOUT - 1.0, clock, queue)
    assert queue.join("a") == 1 and queue.driver == "a"
    queue.disconnect("a")
    passes(RECONNECT_TIMEOUT + 1.0, clock, queue)
    assert queue.driver == "b" and queue.place("a") is None
    assert queue.time_left >= TURN - 2.0  # a whole turn, and not what the other one left


def test_the_line_is_short(queue):
    for name in range(MAX_WAITING + 1):
        queue.join(str(name))
    with pytest.raises(QueueFullError):
        queue.join("late")
    assert queue.join("3") == 4  # who is in line already keeps its place
    assert queue.nb_waiting == MAX_WAITING


class FakeRunner:
    """Notes what it is told, and stands in a state that a test sets."""

    def __init__(self) -> None:
        self.robot = load_robot("hrp2")
        self.told: list[Any] = []
        snapshot = SimpleNamespace(
            status=Status.SOLVED, reference=Reference(), com=SimpleNamespace(position=(0.0, 0.0))
        )
        self.latest = SimpleNamespace(snapshot=snapshot, driver="none", running=True, fault="")

    def drive(self, reference, driver, expires_after, client="") -> None:
        self.robot.check_reference(reference)
        self.told.append((driver, reference))

    def push(self, push) -> None:
        self.told.append(self.robot.check_push(push))

    def reset(self) -> Future:
        self.told.append("reset")
        return Future()

    def resume(self) -> Future:
        self.told.append("resume")
        return Future()

    def taken(self) -> list[Any]:
        """Messages that have come since the last call."""
        told, self.told = self.told, []
        return told


@pytest.fixture
def runner() -> FakeRunner:
    return FakeRunner()


@pytest.fixture
def booth(runner, lease, clock) -> Iterator[Booth]:
    booth = Booth(lambda: runner, lease, clock)
    with booth.screen():
        yield booth


def lives(time: float, clock, booth: Booth) -> None:
    for _ in range(round(time / 0.2)):
        clock.now += 0.2
        booth.step()


def test_it_walks_by_itself_until_somebody_drives_and_again_a_minute_later(booth, runner, clock):
    lives(1.0, clock, booth)
    assert booth.is_attracting and {driver for driver, _ in runner.taken()} == {"booth"}
    booth.queue.join("a")
    lives(1.0, clock, booth)
    assert not booth.is_attracting and runner.taken() == []
    with pytest.raises(NotYourTurnError):
        booth.steer("b", 1.0, 0.0, 0.0)
    booth.steer("a", 1.0, -1.0, 0.0)
    ((driver, reference),) = runner.taken()
    limits = runner.robot.max_reference
    assert driver == "phone" and (reference.vx, reference.vy) == (limits["vx"][1], limits["vy"][0])
    lives(ABSENCE_TIMEOUT + 0.9 * ATTRACT_AFTER, clock, booth)
    assert booth.queue.driver == "" and runner.taken() == []
    lives(0.2 * ATTRACT_AFTER, clock, booth)
    assert booth.is_attracting and runner.taken()


def test_it_leaves_the_robot_to_whoever_drives_at_a_page_or_has_the_lease(booth, runner, lease, clock):
    lives(1.0, clock, booth)
    runner.latest.driver, runner.latest.snapshot.reference = "keyboard", Reference(vx=0.1)
    runner.taken()
    lives(2.0 * ATTRACT_AFTER, clock, booth)
    assert runner.taken() == []
    runner.latest.driver, runner.latest.snapshot.reference = "rest", Reference()  # a program's stop holds forever
    lives(ATTRACT_AFTER + 1.0, clock, booth)
    assert runner.taken()
    lease.give("a", "a")
    lives(1.0, clock, booth)
    assert not booth.is_attracting and booth.problem == ""
    booth.queue.join("b")
    lives(1.0, clock, booth)
    assert "drives alone" in booth.problem and not booth.is_attracting


def test_a_round_shows_all_directions_and_pushes_within_the_bounds_of_visitors(booth, runner, clock):
    lives(sum(stretch.duration for stretch in ROUND) + 3.0, clock, booth)
    told = runner.taken()
    references = [entry[1] for entry in told if isinstance(entry, tuple)]
    pushes = [entry for entry in told if not isinstance(entry, tuple)]
    assert ATTRACT_PUSH_SHARE <= PUSH_SHARE
    assert len(pushes) == sum(stretch.push is not None for stretch in ROUND) == 2
    assert all(math.hypot(*p.impulse) == pytest.approx(ATTRACT_PUSH_SHARE * runner.robot.max_push) for p in pushes)
    assert max(r.vx for r in references) > 0.0 and {math.copysign(1, r.vy) for r in references if r.vy} == {1, -1}
    assert references[-1] == Reference()  # at rest, where the next round begins
    assert "reset" not in told


def test_pushes_of_visitors_are_bounded_in_strength_and_number(booth, runner, clock):
    booth.queue.join("a")
    for _ in range(3):
        booth.push("a", 0.5 * math.pi)
    (push,) = runner.taken()
    assert push.impulse == pytest.approx([0.0, PUSH_SHARE * runner.robot.max_push])
    clock.now += PUSH_PERIOD
    booth.push("a", 0.0)
    assert len(runner.taken()) == 1
    with pytest.raises(NotYourTurnError):
        booth.push("b", 0.0)


@pytest.mark.parametrize("trouble", ["fallen", "fault"])
def test_a_robot_that_lies_or_has_a_fault_stands_up_after_a_moment(booth, runner, clock, trouble):
    booth.queue.join("a")
    if trouble == "fallen":
        runner.latest.snapshot.status = Status.FALLEN
    else:
        runner.latest.fault = "a bug"
    lives(STAND_UP_AFTER - 0.5, clock, booth)
    assert runner.taken() == []
    lives(0.8, clock, booth)
    assert runner.taken() == ["reset", "resume"]
    lives(STAND_UP_AFTER - 0.5, clock, booth)  # which takes a moment, too
    assert runner.taken() == []


def test_whoever_left_it_paused_does_not_end_the_booth(booth, runner, clock):
    runner.latest.running = False
    lives(1.0, clock, booth)
    assert runner.taken()[0] == "resume"


def test_a_robot_that_has_walked_far_begins_anew_between_two_rounds(booth, runner, clock):
    lives(10.0, clock, booth)
    runner.latest.snapshot.com.position = (FAR, 1.0)
    lives(5.0, clock, booth)
    assert "reset" not in runner.taken()
    lives(sum(stretch.duration for stretch in ROUND), clock, booth)
    assert runner.taken().count("reset") == 1


def test_with_the_last_screen_all_visitors_go(runner, lease, clock):
    booth = Booth(lambda: runner, lease, clock)
    with booth.screen():
        with booth.screen():
            booth.queue.join("a")
            booth.step()
        assert booth.is_open and booth.queue.driver == "a" and lease.holder == LEASE
    assert not booth.is_open and booth.queue.driver == "" and lease.holder == ""


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
        with httpx.Client(base_url=f"{server.url}api/v1/", headers=bearer("one")) as api:
            with connect(server.socket_url("booth/screen"), additional_headers=bearer("one")):
                with phone(server, api, "a") as a:
                    told(a, is_open=True, place=0)
                    a.send(json.dumps({"turn": 1.0, "left": 1.0}))
                    wait_for(lambda: api.get("live").json()["driver_client"] == "a")


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"} if token else {}


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
