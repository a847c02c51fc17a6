# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The live view without ROS: its document, its server, and its page in a real browser."""

import json
import math
import socket
import urllib.error
import urllib.request

import pytest
from browser import PROGRAM, browser

from fish_bringup.view_server import HEADER, ViewServer
from fish_bringup.view_state import TRAIL, ViewConfig, ViewState


def swimming(control=False):
    """A robot that swims left of its path."""
    state = ViewState(control)
    for k in range(30):
        state.move(100.0 + 0.1 * k, (-1.0 + 0.02 * k, 0.1, 0.2), 0.2)
    state.path = [(-1.0, 0.0), (1.0, 0.0)]
    state.errors, state.gains = (0.012, -0.1, 0.01), (0.5, 0.1, 0.2, 1.0, 0.05, 0.0)
    state.tail, state.armed = (0.1, 0.2, 0.1), True
    state.health("fusion", 0, "estimating")
    state.health("tracker", 2, "no calibration")
    return state


@pytest.fixture
def served():
    """served(act): a server of a robot that swims."""
    made = []

    def serve(act=None, port=0):
        made.append(ViewServer("127.0.0.1", port, act))
        made[-1].state = swimming(act is not None).document(103.0)
        return made[-1]

    yield serve
    for server in made:
        server.close()


def ask(url, data=None, **headers):
    request = urllib.request.Request(url, data=data, headers=headers)
    with urllib.request.urlopen(request, timeout=20) as answer:
        return answer.read()


def test_the_document_holds_what_was_said_last():
    shown = json.loads(swimming().document(103.0))
    assert shown["pose"] == [-0.42, 0.1, 0.2]
    assert shown["age"] == pytest.approx(0.1)
    assert shown["armed"] is True
    assert shown["health"] == [
        {"node": "fusion", "level": "ok", "message": "estimating"},
        {"node": "tracker", "level": "error", "message": "no calibration"},
    ]


def test_texts_of_foreign_nodes_are_cut():
    state = ViewState()
    state.health("[/x]\x1b[31m", 2, "m" * 5000)
    (shown,) = json.loads(state.document(0.0))["health"]
    assert shown["node"] == "[/x]\\x1b[31m"
    assert len(shown["message"]) < 500


def test_numbers_that_are_none_are_valid_json():
    state = ViewState()
    state.errors = (math.nan, math.inf, 1.0)
    assert json.loads(state.document(0.0))["errors"] == [None, None, 1.0]


def test_the_trail_is_thinned_and_bounded_and_survives_a_clock_that_is_set_back():
    state = ViewState()
    for k in range(10 * TRAIL):
        state.move(0.05 * k, (0.0, 0.0, 0.0), 0.0)
    state.move(1.0, (1.0, 0.0, 0.0), 0.0)
    trail = json.loads(state.document(0.0))["trail"]
    assert len(trail) == TRAIL
    assert trail[-1] == [1.0, 0.0]


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("port", 70000, "expected 1 to 65535"),
        ("address", "", "expected an address"),
        ("rate_hz", 0.0, "1 to 30 Hz"),
    ],
)
def test_a_wrong_parameter_is_refused(field, value, said):
    with pytest.raises(ValueError, match=said):
        ViewConfig(**{field: value})


def test_a_port_in_use_is_one_line(served):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(
            ValueError, match=rf"127.0.0.1:{port}: Address already in use; give another port"
        ):
            served(port=port)


def test_a_view_that_only_shows_takes_no_commands(served):
    server = served()
    assert b"Robot fish" in ask(server.url)
    with pytest.raises(urllib.error.HTTPError, match="403"):
        ask(f"{server.url}disarm", b"", **{HEADER: "1"})


def test_commands_need_the_pages_header_and_this_computers_name(served):
    asked = []
    server = served(asked.append)
    for headers in ({}, {HEADER: "1", "Host": "evil.example:80"}):
        with pytest.raises(urllib.error.HTTPError, match="403"):
            ask(f"{server.url}disarm", b"", **headers)
    with pytest.raises(urllib.error.HTTPError, match="403"):
        ask(f"{server.url}state", Host="evil.example:80")
    assert asked == []
    ask(f"{server.url}disarm", b"", **{HEADER: "1"})
    ask(f"{server.url}arm", b"", **{HEADER: "1"})
    assert asked == [False, True]


@pytest.mark.skipif(PROGRAM is None, reason="no Chromium on this computer")
def test_the_page_shows_the_robot_and_its_button_stops_it(served, tmp_path):
    asked = []
    server = served(asked.append)
    with browser(tmp_path / "profile") as page:
        page.open(server.url)
        page.until("document.getElementById('errors').innerText", lambda t: t and "12 mm" in t)
        assert "tracker" in page.evaluate("document.getElementById('health').innerText")
        assert page.evaluate("document.getElementById('armed').textContent") == "ARMED"
        blue = "Array.from(pen.getImageData(0, 0, pen.canvas.width, pen.canvas.height).data)"
        assert page.evaluate(f"{blue}.filter((v, i) => i % 4 == 3 && v > 0).length") > 500
        page.evaluate("document.getElementById('stop').click()")
        page.until("1", lambda _: asked == [False])
        server.state = swimming(control=False).document(103.0)
        page.until("document.getElementById('stop').disabled")
        server.state = ViewState().document(0.0)
        page.until("document.getElementById('late').textContent", lambda t: t == "no estimate yet")
