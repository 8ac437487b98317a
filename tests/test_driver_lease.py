"""One browser drives alone, hands over, and loses that when it is absent."""

import json

import httpx
import pytest
from conftest import PATIENCE, Server, wait_for
from playwright.sync_api import expect
from scene_reader import SceneSocket, controls
from test_client_messages import set_value
from websockets.sync.client import ClientConnection, connect

from app.live.driver_lease import ABSENCE_TIMEOUT, DriverLease, LeaseHeldError


@pytest.fixture
def lease(clock) -> DriverLease:
    return DriverLease(clock)


def test_without_a_holder_everybody_may_drive(lease):
    for client in ("a", "b", ""):
        lease.check(client)
    assert lease.holder == "" and lease.expires_in == 0.0


def test_a_holder_drives_alone_and_hands_over(lease):
    lease.give("a", by="a")
    lease.check("a")
    for client in ("b", ""):
        with pytest.raises(LeaseHeldError):
            lease.check(client)
        with pytest.raises(LeaseHeldError):
            lease.give(client, by=client)
        with pytest.raises(LeaseHeldError):
            lease.end(by=client)
    lease.give("b", by="a")
    lease.check("b")
    with pytest.raises(LeaseHeldError):
        lease.check("a")
    lease.end(by="b")
    lease.check("a")


def test_a_holder_that_sends_no_command_loses_the_lease(lease, clock):
    lease.give("a", by="a")
    clock.now += 0.9 * ABSENCE_TIMEOUT
    lease.check("a")
    clock.now += 0.9 * ABSENCE_TIMEOUT
    with pytest.raises(LeaseHeldError):
        lease.check("b")
    clock.now += 0.2 * ABSENCE_TIMEOUT
    lease.give("b", by="b")
    assert lease.holder == "b"


def test_connected_controls_are_named(lease):
    with lease.present("b"), lease.present("a"), lease.present("a"):
        assert lease.clients == ["a", "b"]
    assert lease.clients == []


def teleop(server: Server, client: str) -> ClientConnection:
    return connect(server.socket_url(f"teleop?client={client}"))


def steer(socket: ClientConnection, vx: float) -> None:
    socket.send(json.dumps({"reference": {"vx": vx}}))


def driving(api: httpx.Client) -> tuple[str, float]:
    live = api.get("live").json()
    return live["driver_client"], live["reference_vx"]


def test_others_are_refused_once_and_may_stop_the_robot(server, api):
    with teleop(server, "alice") as alice, teleop(server, "bob") as bob:
        wait_for(lambda: api.get("live/lease").json()["clients"] == ["alice", "bob"])
        assert api.put("live/lease", json={"client": "alice"}).json()["holder"] == "alice"
        for _ in range(3):
            steer(bob, 0.1)
        assert "drives alone" in json.loads(bob.recv(timeout=PATIENCE))["error"]
        assert api.put("live/reference", json={"vx": 0.1}).status_code == 409
        assert api.put("live/lease", json={"client": "bob", "by": "bob"}).status_code == 409
        assert api.delete("live/lease?by=bob").status_code == 409

        def alice_drives() -> bool:
            steer(alice, 0.2)
            return driving(api) == ("alice", 0.2)

        wait_for(alice_drives)
        assert api.put("live/reference", json={}).status_code == 200
        wait_for(lambda: driving(api)[1] == 0.0)
        assert api.put("live/lease", json={"client": "bob", "by": "alice"}).json()["holder"] == "bob"

        def bob_drives() -> bool:
            steer(bob, 0.15)
            return driving(api) == ("bob", 0.15)

        wait_for(bob_drives)
        assert api.delete("live/lease?by=bob").json()["holder"] == ""
        assert api.put("live/reference", json={"vx": 0.1}).status_code == 200


def test_sliders_of_others_are_refused_with_the_reason(server, api):
    with teleop(server, "alice"), SceneSocket(f"ws://{server.host}/viewer?client=bob") as bob:
        forward = controls(bob.beginning())["forward [m/s]"]
        wait_for(lambda: api.get("live/lease").json()["clients"] == ["alice"])
        api.put("live/lease", json={"client": "alice"}).raise_for_status()
        bob.send(set_value(forward, value=0.1))
        assert "drives alone" in str(bob.first("NotificationShowMessage"))
        assert driving(api) == ("", 0.0)
        api.delete("live/lease?by=alice").raise_for_status()
        bob.send(set_value(forward, value=0.2))
        wait_for(lambda: driving(api) == ("bob", 0.2))


@pytest.mark.exhaustive
def test_a_person_drives_alone_and_hands_over_on_the_page(server, api, visit):
    page = visit(server.url)
    with teleop(server, "bob") as bob:
        wait_for(lambda: len(api.get("live/lease").json()["clients"]) == 2)
        page.get_by_role("button", name="Help").click()
        choice = page.get_by_test_id("lease")
        choice.select_option("this browser alone")
        wait_for(lambda: api.get("live/lease").json()["holder"] not in ("", "bob"))
        steer(bob, 0.1)
        assert "drives alone" in json.loads(bob.recv(timeout=PATIENCE))["error"]
        choice.select_option("bob")
        wait_for(lambda: api.get("live/lease").json()["holder"] == "bob")
        expect(choice).to_be_disabled()
        api.delete("live/lease?by=bob").raise_for_status()
