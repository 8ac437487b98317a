"""The containers are for their own machine unless told otherwise, limited, and need no root."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parent.parent
SERVICES: dict[str, Any] = yaml.safe_load((ROOT / "compose.yaml").read_text())["services"]
VERSION = re.compile(r":\d+\.\d+[\w.-]*\}?$")


def test_the_server_is_published_on_the_loopback_unless_told():
    assert all(port.startswith("${BIND:-127.0.0.1}:") for port in SERVICES["walk"]["ports"])


@pytest.mark.parametrize("name", SERVICES)
def test_every_container_is_limited_and_started_again(name):
    service = SERVICES[name]
    assert service["restart"] == "unless-stopped" and service["cap_drop"] == ["ALL"]
    assert "no-new-privileges:true" in service["security_opt"]
    assert service["mem_limit"] and service["pids_limit"] and service["logging"]["options"]["max-size"]


def test_the_server_ends_itself_where_it_stays_unhealthy():
    assert float(SERVICES["walk"]["environment"]["EXIT_UNHEALTHY_AFTER"]) > 0.0


def test_the_cluster_starts_by_its_profile_alone_from_the_same_image_and_stays_on_the_loopback():
    scheduler, worker = SERVICES["scheduler"], SERVICES["worker"]
    assert scheduler["profiles"] == worker["profiles"] == ["cluster"]
    assert scheduler["healthcheck"] == worker["healthcheck"] == {"disable": True}, "the image's asks the server"
    assert scheduler["image"] == worker["image"] == SERVICES["walk"]["image"]
    assert scheduler["ports"] == ["${CLUSTER_BIND:-127.0.0.1}:8786:8786"] and "ports" not in worker
    assert worker["command"][1] == f"tcp://scheduler:{scheduler['command'][2]}"


@pytest.mark.parametrize("name", ["scheduler", "worker"])
def test_what_the_cluster_calls_is_in_the_image_and_knows_its_options(name):
    service = SERVICES[name]
    lock = (ROOT / "requirements-runtime.lock").read_text()
    assert re.search(r"^distributed==", lock, re.MULTILINE) and re.search(r"^joblib==", lock, re.MULTILINE)
    program, (command, *options) = service["entrypoint"], service["command"]
    path = Path(sys.executable).with_name(*program)
    help = subprocess.run([path, command, "--help"], capture_output=True, text=True, check=True).stdout
    assert [option for option in options if option.startswith("--") and option not in help] == []


def test_nothing_is_requested_that_an_engine_without_root_refuses():
    assert not {"ulimits", "privileged", "cap_add"} & set(SERVICES["walk"])
    assert "\nUSER walk\n" in (ROOT / "Dockerfile").read_text()


def test_images_are_of_one_version_each():
    base = re.findall(r"^ARG BASE_IMAGE=(.*)$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)
    images = [*base, SERVICES["tls"]["image"], SERVICES["walk"]["build"]["args"]["BASE_IMAGE"]]
    assert len(images) == 3 and all(VERSION.search(image) for image in images)
