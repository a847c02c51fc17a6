# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the verbs view, latency and excite compute."""

import http.client
import json
import math
import socket
import urllib.error
import urllib.request
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import PROGRAM, browser

from fish_bag import find_trials
from fish_bag.trial import NOT_FINITE, Camera, Commands, Imu, Odometry, Trial
from fish_bringup.excite_check import LONGEST_GAPS, commands_of, incomplete
from fish_bringup.verbs.latency import all_measured, measured, table, together
from fish_bringup.view_server import HEADER, ViewServer, _Handler
from fish_bringup.view_state import TRAIL, ViewConfig, ViewState
from fish_control.excitation import Program, Row
from fish_control.offset_sums import ClockEstimate
from fish_control.pool import HALF_WIDTH
from fish_sim.model import DT

RECORDINGS = Path(__file__).parents[3] / "examples" / "hidden_drag" / "recordings"


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

    def serve(act=None, port=0, address="127.0.0.1"):
        made.append(ViewServer(address, port, act))
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


@pytest.mark.parametrize(
    ("host", "taken"),
    [
        ("127.0.0.1:8080", True),
        ("localhost", True),
        ("192.168.0.7:8080", True),
        ("[fe80::1]:8080", True),
        ("evil.example:8080", False),
        ("127.0.0.1.evil.example", False),
        ("[", False),
        ("", False),
    ],
)
@pytest.mark.parametrize("address", ["127.0.0.1", "0.0.0.0"])
def test_a_name_that_another_site_leads_here_is_refused(served, address, host, taken):
    asked = []
    port = served(asked.append, address=address).port
    for way, path in (("GET", "/state"), ("POST", "/arm")):
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
        connection.request(way, path, headers={HEADER: "1", "Host": host})
        assert connection.getresponse().status == (200 if taken else 403)
        connection.close()
    assert asked == [True] * taken


def test_the_name_that_it_is_served_by_is_taken(served):
    server = served()
    url, server.address = f"{server.url}state", "Fish.local"  # a name of this computer
    assert ask(url, Host="fish.local:8080")


@pytest.mark.parametrize("length", ["1025", "99999999999", "9" * 5000, "-1", "abc", ""])
@pytest.mark.parametrize(("headers", "status"), [({}, 403), ({HEADER: "1"}, 400)])
def test_a_body_is_not_awaited_before_its_sender_and_length_are_judged(
    served, length, headers, status
):
    asked = []
    connection = http.client.HTTPConnection("127.0.0.1", served(asked.append).port, timeout=20)
    connection.request("POST", "/arm", headers={"Content-Length": length, **headers})
    answer = connection.getresponse()
    assert (answer.status, answer.will_close, asked) == (status, True, [])
    connection.close()


def test_a_connection_without_a_request_is_closed(served, monkeypatch):
    monkeypatch.setattr(_Handler, "timeout", 0.1)
    server = served()
    with socket.create_connection(("127.0.0.1", server.port), timeout=20) as idle:
        assert idle.recv(1) == b""
    assert ask(server.url)


def test_a_body_that_is_not_read_is_no_request(served):
    asked = []
    server = served(asked.append)
    inner = f"POST /arm HTTP/1.1\r\nHost: 127.0.0.1\r\n{HEADER}: 1\r\n\r\n"
    outer = f"POST /arm HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: {len(inner)}\r\n\r\n"
    with socket.create_connection(("127.0.0.1", server.port), timeout=20) as peer:
        peer.sendall((outer + inner).encode())
        with peer.makefile("rb") as answer:
            assert b" 403 " in answer.readline()
            assert b"HTTP/1.1" not in answer.read()
    assert asked == []


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


def stream(t, delay):
    return {
        "topic": "",
        "frame_id": "",
        "t": t,
        "t_arrival": t + delay,
        "flags": np.zeros(len(t), dtype=np.uint8),
    }


def heading(t):
    return 0.2 * np.sin(4.0 * np.pi * t) * (1.0 + 0.3 * np.sin(0.7 * t)) + 0.3 * np.sin(0.8 * t)


def recording(late, lead=None):
    """A trial whose camera stamps are `late` s later than the exposure; the orientation leads the gyro, or measures nothing."""
    t, exposed = np.arange(0.0, 30.0, 0.01), np.arange(0.0, 30.0, 1.0 / 30.0)
    gyro = np.column_stack([0.0 * t, 0.0 * t, np.gradient(heading(t), t)])
    orientation = np.full((len(t), 4), np.nan)
    if lead is not None:
        half = 0.5 * heading(t + lead)
        orientation = np.column_stack([0.0 * t, 0.0 * t, np.sin(half), np.cos(half)])
        gyro *= 0.7
    imu = Imu(**stream(t, 0.01), gyro=gyro, accel=0.0 * gyro, orientation=orientation)
    seen = heading(exposed) + np.random.default_rng(2).normal(0.0, 0.01, len(exposed))
    camera = Camera(
        **stream(exposed + late, 0.05),
        x=0.0 * seen,
        y=0.0 * seen,
        psi=seen,
        covariance=np.zeros((len(seen), 3, 3)),
    )
    return Trial("swim", Path("swim"), 0, 30.0, "/fish", "recorder", imu=imu, camera=camera)


def shown(found):
    """What the table says of one recording, by column."""
    page = table([("swim", found)])
    return dict(zip(page.header, page.rows[0], strict=True))


def test_the_offset_stands_in_the_table():
    found = measured(recording(0.3))
    assert found.recorded.estimate.offset == pytest.approx(-0.3, abs=0.003)
    assert found.recorded.age == pytest.approx(0.34, abs=0.005)
    row = shown(found)
    assert row["recording"] == "swim"
    assert float(row["offset s"]) == pytest.approx(-0.3, abs=0.003)
    assert float(row["lead s"]) == pytest.approx(0.0, abs=0.001)
    assert row["sure"] == "yes"


def test_an_orientation_that_leads_the_gyro_is_named_and_the_offset_said_to_both():
    row = shown(measured(recording(0.3, lead=0.015)))
    assert float(row["lead s"]) == pytest.approx(0.015, abs=0.002)
    assert float(row["offset s"]) == pytest.approx(-0.315, abs=0.003)
    assert float(row["to gyro s"]) == pytest.approx(-0.3, abs=0.003)


def test_recordings_that_differ_say_so():
    at = [ClockEstimate(o, 0.001, True) for o in (-0.30, -0.31, -0.32)]
    assert "differ by" in together(at)
    assert "differ" not in together(at[:1])


@pytest.mark.parametrize(("field", "topic"), [("imu", "imu/data"), ("camera", "camera/pose")])
def test_a_missing_sensor_is_named(field, topic):
    with pytest.raises(ValueError, match=f"swim: no {topic}"):
        measured(replace(recording(0.1), **{field: None}))


def test_a_recording_that_cannot_tell_is_left_out_and_the_others_are_measured(tmp_path):
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(b"no recording")
    found, (why,) = all_measured([broken, *find_trials(RECORDINGS)[:1]], None)
    assert len(found) == 1
    assert "broken.mcap" in why


EXCITATION = Program((Row(0.0, 5.0, 2.0, 0.0), Row(3.0, 6.0, 2.5, 0.4)))
BEGIN, END = 1.0, 9.0
REST = 100  # commands at rest before the first stroke


def excited_stream(kind, topic, t, **arrays):
    return kind(
        topic=topic, frame_id="", t=t, t_arrival=t, flags=np.zeros(len(t), np.uint8), **arrays
    )


@pytest.fixture
def trial(tmp_path):
    """A whole recording: a second at rest, the program, two seconds of gliding."""
    told = np.concatenate(
        [np.zeros((REST, 3)), commands_of(EXCITATION, BEGIN, END), np.zeros((200, 3))]
    )
    t = 0.013 + DT * np.arange(len(told))
    nothing, frames = np.zeros(len(t)), np.arange(0.0, t[-1], 1.0 / 30.0)
    still = np.zeros(len(frames))
    return Trial(
        name="a",
        path=tmp_path,
        origin_ns=0,
        duration=float(t[-1]),
        namespace="/fish",
        axis="robot",
        commands=excited_stream(
            Commands,
            "/fish/joint_command",
            t,
            rotor_phase=told[:, 0],
            rotor_speed=told[:, 1],
            rudder=told[:, 2],
        ),
        imu=excited_stream(
            Imu,
            "/fish/imu/data",
            t,
            gyro=np.zeros((len(t), 3)),
            accel=np.zeros((len(t), 3)),
            orientation=np.zeros((len(t), 4)),
        ),
        camera=excited_stream(
            Camera,
            "/fish/camera/pose",
            frames,
            x=still,
            y=still,
            psi=still,
            covariance=np.zeros((len(frames), 3, 3)),
        ),
        truth=excited_stream(
            Odometry,
            "/fish/sim/odometry",
            t,
            x=nothing,
            y=nothing,
            psi=nothing,
            u=nothing,
            v=nothing,
            r=nothing,
        ),
    )


def without(excited_stream, first, last):
    """Less the samples from `first` to `last` [s] on the recording's axis."""
    return excited_stream.take((excited_stream.t < first) | (excited_stream.t > last))


def lacks(trial, **changed):
    return incomplete(replace(trial, **changed), EXCITATION, BEGIN, END)


def test_a_whole_recording_lacks_nothing(trial):
    assert lacks(trial) == []


@pytest.mark.parametrize("count", [1, 14])
def test_lost_commands_are_said_with_their_time(trial, count):
    kept = np.delete(np.arange(len(trial.commands)), np.arange(REST + 250, REST + 250 + count))
    (said,) = lacks(trial, commands=trial.commands.take(kept))
    assert (
        f"missing from 2.50 to {2.5 + DT * count:.2f} s after the first stroke ({count} commands)"
        in said
    )


def test_the_first_commands_are_missed_too(trial):
    kept = np.delete(np.arange(len(trial.commands)), [REST, REST + 1, REST + 2])
    (said,) = lacks(trial, commands=trial.commands.take(kept))
    assert "missing from 0.00 to 0.03 s" in said


def test_a_command_at_another_time_is_missing_at_its_own(trial):
    t = trial.commands.t.copy()
    t[REST + 100] += 0.004
    (said,) = lacks(trial, commands=replace(trial.commands, t=t))
    assert "missing from 1.00 to 1.01 s" in said


def test_a_command_that_cannot_be_read_is_missing(trial):
    flags = trial.commands.flags.copy()
    flags[REST + 100] = NOT_FINITE
    assert "(1 commands)" in lacks(trial, commands=replace(trial.commands, flags=flags))[0]


def test_commands_of_somebody_else_are_not_the_programs(trial):
    rudder = trial.commands.rudder.copy()
    rudder[REST + 400 : REST + 410] = -0.3
    (said,) = lacks(trial, commands=replace(trial.commands, rudder=rudder))
    assert said.startswith("10 of 800 commands are not the program's, the first 4.00 s after")


def test_a_row_that_begins_a_command_late_is_the_programs(trial):
    rudder = trial.commands.rudder.copy()
    rudder[REST + 200] = rudder[REST + 199]  # the row of 3 s, the program began at 1 s
    assert rudder[REST + 199] != rudder[REST + 201]
    assert lacks(trial, commands=replace(trial.commands, rudder=rudder)) == []


@pytest.mark.parametrize("role", LONGEST_GAPS)
def test_a_sensor_that_is_silent_or_absent_is_said(trial, role):
    sensor, longest = getattr(trial, role), LONGEST_GAPS[role]
    assert lacks(trial, **{role: without(sensor, 4.0, 4.0 + 0.5 * longest)}) == []
    (said,) = lacks(trial, **{role: without(sensor, 4.0, 4.0 + 1.1 * longest)})
    assert f"{sensor.topic} is silent for" in said
    assert f"expected {longest:g} s at most" in said
    (said,) = lacks(trial, **{role: without(sensor, 5.0, np.inf)})
    assert "is silent for" in said
    assert lacks(trial, **{role: None}) == [f"nothing of the {role} was recorded"]


def test_a_fish_at_a_wall_swam_in_no_free_water(trial):
    y = trial.truth.y.copy()
    y[REST + 300 : REST + 320] = HALF_WIDTH
    (said,) = lacks(trial, truth=replace(trial.truth, y=y))
    assert said == "the fish touched a wall at 4.00 s of the program"


def test_a_recording_without_commands_or_strokes_is_said(trial):
    assert lacks(trial, commands=None) == ["no joint_command was recorded"]
    at_rest = replace(trial.commands, rotor_phase=np.zeros(len(trial.commands)))
    assert lacks(trial, commands=at_rest) == ["no joint_command turns the rotor"]
