"""Roles: the operator's token may do everything, the viewer's only look; places for those who look are bounded."""

import time

import httpx
import pytest
from conftest import PATIENCE, Server, bearer, serving, wait_for
from playwright.sync_api import expect
from pydantic import ValidationError
from scene_reader import CAMERA, SceneSocket, controls
from test_client_messages import set_value
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from app.http.wrong_tokens import FREE, LONGEST, MAX_ADDRESSES, WrongTokens
from app.settings import Settings

OPERATOR, VIEWER = "operator-token", "viewer-token"
pytestmark = pytest.mark.server("hrp2", WALK_TOKEN=OPERATOR, WALK_VIEW_TOKEN=VIEWER, SPECTATORS="2")


def requests(server: Server, token: str) -> httpx.Client:
    return httpx.Client(base_url=server.url, headers=bearer(token), timeout=PATIENCE)


def scene(server: Server, token: str) -> SceneSocket:
    return SceneSocket(f"ws://{server.host}/viewer", additional_headers=bearer(token))


def operations(server: Server) -> list[tuple[str, str]]:
    """Every method and path of the API that changes something."""
    paths = httpx.get(f"{server.url}openapi.json", headers=bearer(OPERATOR)).json()["paths"]
    return [(method, path) for path, found in paths.items() for method in found if method not in ("get", "head")]


def test_a_viewer_looks(server):
    with requests(server, VIEWER) as viewer:
        for path in ("", "viewer/", "docs", "metrics", "api/v1/live", "api/v1/runs", "api/v1/live/parameters"):
            assert viewer.get(path).status_code == 200, path
        assert viewer.get("api/v1/session").json() == {"role": "viewer"}
    with requests(server, OPERATOR) as operator:
        assert operator.get("api/v1/session").json() == {"role": "operator"}
    with connect(server.socket_url("stream"), additional_headers=bearer(VIEWER)) as stream:
        assert stream.recv(timeout=PATIENCE)


def test_a_viewer_changes_nothing_by_any_route(server):
    assert len(operations(server)) > 10
    with requests(server, VIEWER) as viewer:
        for method, path in operations(server):
            answer = viewer.request(method, path.replace("{run_id}", "x"), json={})
            assert answer.status_code == 403 and "operator" in answer.json()["detail"], path


def test_a_viewer_does_not_drive(server):
    with pytest.raises(InvalidStatus) as refusal:
        connect(server.socket_url("teleop"), additional_headers=bearer(VIEWER)).close()
    assert refusal.value.response.status_code == 403


def test_a_viewer_moves_no_slider_of_the_panel(server):
    with scene(server, VIEWER) as viewer, scene(server, OPERATOR) as operator, requests(server, OPERATOR) as api:
        forward = controls(viewer.beginning())["forward [m/s]"]
        operator.beginning()
        viewer.send(set_value(forward, value=0.2))
        viewer.send(CAMERA)
        operator.send(set_value(forward, value=0.1))
        wait_for(lambda: api.get("api/v1/live").json()["driver"] == "sliders")
        assert api.get("api/v1/live").json()["reference_vx"] == 0.1


def seated(server: Server) -> SceneSocket:
    """A viewer's scene, opened as soon as those of earlier tests are gone."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return scene(server, VIEWER)
        except InvalidStatus:
            assert time.monotonic() < end


def test_places_are_bounded_and_an_operator_finds_one_always(server):
    with seated(server), seated(server), requests(server, VIEWER) as viewer:
        with pytest.raises((InvalidStatus, ConnectionClosed)), scene(server, VIEWER) as third:
            third.read()
        full = viewer.get("")
        assert full.status_code == 503 and "places are taken" in full.text and int(full.headers["retry-after"]) > 0
        with scene(server, OPERATOR) as operator, requests(server, OPERATOR) as client:
            assert client.get("").status_code == 200
            assert operator.read()
    with requests(server, VIEWER) as viewer:
        wait_for(lambda: viewer.get("").status_code == 200)


def test_a_viewer_sees_a_page_without_controls(server, visit):
    page = visit(server.url)
    page.get_by_label("Token").fill(VIEWER)
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_test_id("driver")).to_contain_text("you are watching")
    for control in ("joystick", "joystick-turn", "push", "zero", "stop"):
        expect(page.get_by_test_id(control)).to_be_hidden()
    expect(page.get_by_test_id("viewer")).to_be_visible()


@pytest.mark.parametrize("tokens", [("", VIEWER), (OPERATOR, OPERATOR)])
def test_a_view_token_without_an_operators_token_is_refused(monkeypatch, tokens):
    monkeypatch.setenv("WALK_TOKEN", tokens[0])
    monkeypatch.setenv("WALK_VIEW_TOKEN", tokens[1])
    with pytest.raises(ValidationError, match="WALK_VIEW_TOKEN"):
        Settings()


def test_wrong_tokens_are_delayed_longer_and_longer():
    wrong, now, waits = WrongTokens(), 0.0, []
    for k in range(FREE + 12):
        wrong.count("10.0.0.1", f"guess {k}".encode(), now)
        waits.append(wrong.wait("10.0.0.1", now))
        now += waits[-1]
    assert waits[:FREE] == FREE * [0.0] and waits == sorted(waits) and waits[-1] == LONGEST
    assert waits[FREE] > 0.0 and wrong.wait("10.0.0.2", now) == 0.0


def test_the_same_wrong_token_again_is_no_guess():
    wrong = WrongTokens()
    for _ in range(1000):
        wrong.count("10.0.0.1", b"the old token", 0.0)
    assert wrong.wait("10.0.0.1", 0.0) == 0.0


def test_addresses_that_one_host_has_at_will_count_as_one():
    wrong = WrongTokens()
    for k in range(FREE + 3):
        wrong.count(f"2001:db8::{k + 1:x}", f"guess {k}".encode(), 0.0)
    assert wrong.wait("2001:db8::ffff", 0.0) > 0.0 and wrong.wait("2001:db8:0:1::1", 0.0) == 0.0


def test_guesses_from_many_addresses_are_few_a_second_and_are_not_all_remembered():
    wrong, now, nb_guesses = WrongTokens(), 0.0, 20 * MAX_ADDRESSES
    for k in range(nb_guesses):
        address = f"10.{k >> 16 & 255}.{k >> 8 & 255}.{k & 255}"
        now += wrong.wait(address, now)
        wrong.count(address, f"guess {k}".encode(), now)
    assert nb_guesses / now < 6.0
    assert len(wrong._records) <= MAX_ADDRESSES


def test_a_guesser_is_refused_even_with_the_right_token_and_who_has_signed_in_goes_on():
    with serving("--robot", "hrp2", "--scene", "light", WALK_TOKEN=OPERATOR) as server:
        with httpx.Client(base_url=server.url) as client, httpx.Client(base_url=server.url) as guesser:
            assert client.post("signin", data={"token": OPERATOR}).status_code == 303
            statuses = [guesser.get("api/v1/live", headers=bearer(f"guess {k}")).status_code for k in range(FREE + 5)]
            assert statuses[:FREE] == FREE * [401] and 429 in statuses
            refused = guesser.get("api/v1/live", headers=bearer(OPERATOR))
            assert refused.status_code == 429 and int(refused.headers["retry-after"]) > 0
            assert "wait=" in guesser.post("signin", data={"token": OPERATOR}).headers["location"]
            assert client.get("api/v1/live").status_code == 200
