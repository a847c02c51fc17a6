# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The commands calibrate and check_image, called as from the shell, and the page on which a person clicks.

Requests to the page that are no clicks are refused, and the points come back.
"""

import json
import re
import socket
import struct
import subprocess
import sys
import threading
import urllib.error
import urllib.parse
import urllib.request
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from pool_picture import CONFIG, calibration, discs_of_fish, draw, with_tag

from fish_vision import check_image
from fish_vision.calibration import lens_document
from fish_vision.config import config_from_file
from fish_vision.tags import tag_picture
from fish_vision.tracker import Detection, Tracker
from fish_vision.verbs import calibrate
from fish_vision.verbs.pictures import PickingPage, Points

DATA = Path(__file__).parent / "data"


def call(command, monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", [command.__name__, *map(str, arguments)])
    return command.main()


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with lens.yaml, points.csv, params.yaml and fish.png that belong together."""
    monkeypatch.chdir(tmp_path)
    lens = lens_document(calibration().lens, "overhead")
    (tmp_path / "lens.yaml").write_text(yaml.safe_dump(lens))
    points = np.array([[2.0, 1.0], [-2.0, 1.0], [-2.0, -1.0], [2.0, -1.0]])
    rows = np.column_stack([points, calibration().pool_to_pixel(points)])
    np.savetxt(tmp_path / "points.csv", rows, delimiter=",", header="x,y,u,v", comments="")
    mount = {
        "camera_position": list(CONFIG.camera_position),
        "camera_tilt": list(CONFIG.camera_tilt),
    }
    (tmp_path / "params.yaml").write_text(yaml.safe_dump({"/**": {"ros__parameters": mount}}))
    cv2.imwrite(str(tmp_path / "fish.png"), draw(discs_of_fish(0.5, 0.2, 1.0)))
    return tmp_path


def test_check_image_prints_the_pose_and_draws_it(files: Path, monkeypatch, capsys) -> None:
    arguments = (
        "--lens",
        files / "lens.yaml",
        "--params",
        files / "params.yaml",
        "--out",
        files / "out.png",
    )
    assert call(check_image, monkeypatch, files / "fish.png", *arguments) == 0
    printed = capsys.readouterr().out
    assert "head +0.5" in printed
    assert "+0.2" in printed
    assert "heading +1.0" in printed
    assert cv2.imread(str(files / "out.png")).shape == (720, 1280, 3)


def test_check_image_says_what_is_missing(files: Path, monkeypatch, capsys) -> None:
    cv2.imwrite(str(files / "empty.png"), draw([]))
    arguments = (
        "--lens",
        files / "lens.yaml",
        "--params",
        files / "params.yaml",
        "--out",
        files / "out.png",
    )
    assert call(check_image, monkeypatch, files / "empty.png", *arguments) == 1
    assert "no front marker" in capsys.readouterr().out
    assert call(check_image, monkeypatch, files / "none.png", "--lens", files / "lens.yaml") == 1
    assert "none.png" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["out.xyz", "out", "no_folder/out.png"])
def test_check_image_says_in_one_line_that_it_cannot_write(
    files: Path, monkeypatch, capsys, name: str
) -> None:
    arguments = (
        "--lens",
        files / "lens.yaml",
        "--params",
        files / "params.yaml",
        "--out",
        files / name,
    )
    assert call(check_image, monkeypatch, files / "fish.png", *arguments) == 1
    error = capsys.readouterr().err
    assert error.startswith("check_image: ")
    assert name in error
    assert error.count("\n") == 1


def test_check_image_does_not_draw_over_its_picture(files: Path, monkeypatch, capsys) -> None:
    before = (files / "fish.png").read_bytes()
    given = ("fish.png", "--lens", "lens.yaml", "--params", "params.yaml", "--out", "fish.png")
    assert call(check_image, monkeypatch, *given) == 1
    assert "check_image: --out: fish.png is the input fish.png" in capsys.readouterr().err
    assert (files / "fish.png").read_bytes() == before


def test_calibrate_mount_names_the_line_that_is_no_number(files: Path, monkeypatch, capsys) -> None:
    rows = (files / "points.csv").read_text().splitlines()
    rows[2] = "nan,1,2,3"
    (files / "points.csv").write_text("\n".join(rows))
    mount = (
        "mount",
        files / "points.csv",
        "--lens",
        files / "lens.yaml",
        "--out",
        files / "mount.yaml",
    )
    assert call(calibrate, monkeypatch, *mount) == 1
    error = capsys.readouterr().err
    assert "points.csv: line 3 has [nan, 1.0, 2.0, 3.0]" in error
    assert error.count("\n") == 1
    assert not (files / "mount.yaml").exists()


def test_calibrate_overwrites_no_parameters_of_the_user(files: Path, monkeypatch, capsys) -> None:
    before = (files / "params.yaml").read_text()
    for what in (
        ("mount", files / "points.csv", "--lens", files / "lens.yaml"),
        ("lens", "no.png", "--corners", "8x6", "--square", "0.03"),
    ):
        assert call(calibrate, monkeypatch, *what, "--out", files / "params.yaml") == 1
        assert "params.yaml: exists already; expected a new file" in capsys.readouterr().err
    assert (files / "params.yaml").read_text() == before


@pytest.mark.parametrize("square", ["nan", "inf"])
def test_calibrate_lens_refuses_a_square_without_a_size(
    files: Path, monkeypatch, capsys, square: str
) -> None:
    arguments = (
        "lens",
        files / "fish.png",
        "--corners",
        "7x5",
        "--square",
        square,
        "--out",
        "new.yaml",
    )
    assert call(calibrate, monkeypatch, *arguments) == 1
    assert "expected like 8x6" in capsys.readouterr().err


def test_calibrate_mount_writes_params_of_the_tracker(files: Path, monkeypatch, capsys) -> None:
    arguments = (
        "mount",
        files / "points.csv",
        "--lens",
        files / "lens.yaml",
        "--out",
        files / "mount.yaml",
    )
    assert call(calibrate, monkeypatch, *arguments) == 0
    config = config_from_file(files / "mount.yaml")
    assert config.camera_position == pytest.approx(CONFIG.camera_position, abs=1e-4)
    assert config.camera_tilt == pytest.approx(CONFIG.camera_tilt, abs=1e-4)
    printed = capsys.readouterr().out
    assert "4 points, error 0.00 pixels rms, 0.0 mm on the water plane" in printed
    assert cv2.imread(str(files / "mount.png")).shape == (720, 1280, 3)


def test_calibrate_mount_finds_tags_at_known_places(files: Path, monkeypatch, capsys) -> None:
    places = [(7, 1.5, 0.8), (3, -1.5, 0.8), (4, -1.5, -0.8), (9, 1.5, -0.8), (20, 0.0, 0.0)]
    pond = draw([])
    for number, x, y in places[:4]:
        pond = with_tag(pond, tag_picture("4X4_50", number), x, y, 0.2 * number, 0.12)
    cv2.imwrite(str(files / "tags.png"), pond)
    rows = "".join(f"{n},{x},{y}\n" for n, x, y in places)
    (files / "tags.csv").write_text("id,x,y\n" + rows)
    given = ("mount", "tags.csv", "--lens", "lens.yaml", "--image", "tags.png")
    assert call(calibrate, monkeypatch, *given) == 0
    config = config_from_file(files / "mount.yaml")
    assert config.camera_position == pytest.approx(CONFIG.camera_position, abs=5e-3)
    assert "4 points" in capsys.readouterr().out
    again = (*given, "--dictionary", "5X5_50", "--out", "other.yaml", "--picture", "other.png")
    assert call(calibrate, monkeypatch, *again) == 1
    assert "tags none of 7, 3, 4, 9, 20 were found: expected 4" in capsys.readouterr().err


@pytest.fixture
def pond(files: Path) -> Path:
    """The working directory with pond.png: a pool of 4 x 2 m with a pale rim, and its fish."""
    picture = np.full((720, 1280, 3), (112, 116, 118), np.uint8)
    for length, width, colour in ((4.1, 2.1, (205, 205, 200)), (4.0, 2.0, (190, 165, 90))):
        half = np.array([length, width]) / 2
        corners = calibration().pool_to_pixel([half, half * [-1, 1], -half, half * [1, -1]])
        cv2.fillPoly(picture, [np.round(corners * 16).astype(np.int32)], colour, cv2.LINE_AA, 4)
    cv2.imwrite(str(files / "pond.png"), picture)
    return files


def test_calibrate_mount_finds_the_pools_outline(pond: Path, monkeypatch, capsys) -> None:
    given = ("mount", "--find", "--lens", "lens.yaml", "--image", "pond.png")
    assert call(calibrate, monkeypatch, *given, "--pool", "4x2") == 0
    config = config_from_file(pond / "mount.yaml")
    assert config.camera_position == pytest.approx(CONFIG.camera_position, abs=0.01)
    printed = capsys.readouterr().out
    assert re.search(r"error 0\.\d+ pixels rms, \d\.\d mm on the water plane", printed)
    drawn = cv2.imread(str(pond / "mount.png"))
    assert np.any(drawn != cv2.imread(str(pond / "pond.png")))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("--image", "pond.png", "--pool", "5x2"), "no rectangle of 5 x 2 m"),
        (("--image", "pond.png", "--pool", "4"), "--pool 4: expected sides in metres"),
        (("--image", "pond.png", "--pool", "4xnan"), "--pool 4xnan: expected sides in metres"),
        ((), "--find needs a picture and no list of points"),
        (("points.csv", "--image", "pond.png"), "--find needs a picture and no list of points"),
        (("--image", "none.png"), "none.png: no such picture"),
    ],
)
def test_calibrate_mount_finds_nothing_rather_than_something_wrong(
    pond: Path, monkeypatch, capsys, given: tuple[str, ...], message: str
) -> None:
    assert call(calibrate, monkeypatch, "mount", "--find", "--lens", "lens.yaml", *given) == 1
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (pond / "mount.yaml").exists()


class Person:
    """Runs a command that serves a page, and clicks there."""

    def __init__(self, *arguments: str) -> None:
        command = [sys.executable, "-m", "fish_vision.verbs.calibrate", *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        self.address = re.search(r"http://127\.0\.0\.1:\d+/", line)[0]

    def ask(self, where: str, points: dict[str, list[float]] | None = None) -> bytes:
        data = None if points is None else json.dumps(points).encode()
        with urllib.request.urlopen(self.address + where, data, timeout=60) as answer:
            return answer.read()

    def ends(self) -> str:
        """What the command prints after the page."""
        printed, _ = self.process.communicate(timeout=120)
        assert self.process.returncode == 0
        return printed


def test_calibrate_mount_lets_a_person_click_points_of_the_pool(files: Path) -> None:
    (files / "places.csv").write_text("x,y\n2,1\n-2,1\n-2,-1\n2,-1\n")
    person = Person("mount", "places.csv", "--lens", "lens.yaml", "--image", "fish.png")
    page = person.ask("").decode()
    names = json.loads(re.search(r"const names = (\[.*?\])", page)[1])
    assert len(names) == 4
    corners = {name: [float(v) for v in name.split()] for name in names}
    pixels = {n: calibration().pool_to_pixel([xy])[0].tolist() for n, xy in corners.items()}
    few = json.loads(person.ask("preview", dict(list(pixels.items())[:3])))
    assert few == {"text": "3 of 4 points or more", "picture": ""}
    whole = json.loads(person.ask("preview", pixels))
    assert whole["text"] == "error 0.00 pixels rms, 0.0 mm on the water plane"
    assert whole["picture"]
    person.ask("done", pixels)
    assert "camera 3.000 m high" in person.ends()
    assert cv2.imread(str(files / "mount.png")).shape == (720, 1280, 3)
    config = config_from_file(files / "mount.yaml")
    assert config.camera_position == pytest.approx(CONFIG.camera_position, abs=1e-4)


def test_calibrate_colours_lets_a_person_click_the_markers(files: Path) -> None:
    place = {"front": (0.045, 0.0), "rear": (-0.045, 0.0)}
    place |= {"tail_odd": (-0.075 - 0.07 / 3, 0.0), "tail_even": (-0.075 - 2 * 0.07 / 3, 0.0)}
    cv2.imwrite(str(files / "ahead.png"), draw(discs_of_fish(0.5, 0.2, 0.0)))
    points = {
        name: calibration().pool_to_pixel([[0.5 + x, 0.2 + y]])[0].tolist()
        for name, (x, y) in place.items()
    }
    given = ("--lens", "lens.yaml", "--params", "params.yaml", "--page")
    person = Person("colours", "ahead.png", *given)
    shown = json.loads(person.ask("preview", {"front": points["front"]}))
    assert shown["text"].startswith("front: [")
    assert shown["picture"]
    person.ask("done", points)
    printed = person.ends()
    assert "the tracker sees the fish in 1 of 1 pictures" in printed
    assert re.search(r"[\d.]+ pixels rms, [\d.]+ mm on the water plane", printed)
    config = config_from_file(files / "colours.yaml")
    low, high, *_ = config.front_colour
    assert low < 25 < high  # hue of the drawn yellow


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("x,y\n1,2\n", "no pixels: expected --image or --topic"),
        ("a,b\n1,2\n", "header x,y,u,v or id,x,y or x,y"),
        ("x,y,u,v\n1,2,3,a\n", "header x,y,u,v"),
        ("x,y,u,v\n\n0,5,1,5,3,0,4,0\n", "line 3 has 8 fields for 4 names"),
        ("x,y\n0,5,1,5\n", "line 2 has 4 fields for 2 names"),
        ("id,x,y\n7.5,1,2\n", "an id is no whole number"),
        ("\ufeffx, y,u,v\n", "at least 4"),
        ("x,y,u,v\n", "at least 4"),
    ],
)
def test_calibrate_mount_refuses_other_files(
    files: Path, monkeypatch, capsys, content: str, message: str
) -> None:
    (files / "points.csv").write_text(content)
    assert (
        call(calibrate, monkeypatch, "mount", files / "points.csv", "--lens", files / "lens.yaml")
        == 1
    )
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda rows: rows * [1, -1, 1, 1], "is y counted downwards"),
        (
            lambda rows: np.column_stack([rows[:, :2], rows[::-1, 2:]]),
            "in another order than the pixels",
        ),
        (
            lambda rows: np.column_stack([rows[:, :2], np.full((4, 2), 100.0)]),
            "no camera sees the points",
        ),
    ],
    ids=["y downwards", "pixels in reverse", "one pixel"],
)
def test_calibrate_mount_refuses_points_that_no_camera_above_sees(
    files: Path, monkeypatch, capsys, change, message
) -> None:
    rows = change(np.loadtxt(files / "points.csv", delimiter=",", skiprows=1))
    np.savetxt(files / "points.csv", rows, delimiter=",", header="x,y,u,v", comments="")
    mount = (
        "mount",
        files / "points.csv",
        "--lens",
        files / "lens.yaml",
        "--out",
        files / "mount.yaml",
    )
    assert call(calibrate, monkeypatch, *mount) == 1
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (files / "mount.yaml").exists()


def test_check_image_says_which_parameter_has_the_wrong_type(
    files: Path, monkeypatch, capsys
) -> None:
    params = files / "params.yaml"
    params.write_text("/**: {ros__parameters: {tail_links: 3.0}}")
    arguments = ("--lens", files / "lens.yaml", "--params", params, "--out", files / "out.png")
    assert call(check_image, monkeypatch, files / "fish.png", *arguments) == 1
    assert (
        capsys.readouterr().err
        == f"check_image: {params}: tail_links is 3.0, expected int such as 3\n"
    )


def test_calibrate_mount_refuses_mistaken_points(files: Path, monkeypatch, capsys) -> None:
    rows = (files / "points.csv").read_text().splitlines()
    x, y, u, v = rows[1].split(",")
    rows[1] = ",".join([x, y, str(float(u) - 80), v])
    (files / "points.csv").write_text("\n".join(rows))
    assert (
        call(calibrate, monkeypatch, "mount", files / "points.csv", "--lens", files / "lens.yaml")
        == 1
    )
    assert "mistaken" in capsys.readouterr().err


def test_calibrate_lens_refuses_pictures_without_a_board(files: Path, monkeypatch, capsys) -> None:
    arguments = (
        "lens",
        files / "fish.png",
        "--corners",
        "7x5",
        "--square",
        "0.05",
        "--out",
        "new.yaml",
    )
    assert call(calibrate, monkeypatch, *arguments) == 1
    assert "found in 0 of 1" in capsys.readouterr().err
    assert (
        call(
            calibrate,
            monkeypatch,
            "lens",
            files / "fish.png",
            "--corners",
            "7",
            "--square",
            "0.05",
            "--out",
            "new.yaml",
        )
        == 1
    )
    assert "expected like 8x6" in capsys.readouterr().err


@pytest.mark.parametrize("stretch", [1.0, 1.04])
def test_calibrate_lens_says_that_the_error_is_large(
    files: Path, monkeypatch, capsys, stretch: float
) -> None:
    """With a stretch two of the pictures are those of another lens."""
    photographs = [cv2.imread(str(DATA / f"chessboard_{i}.jpg")) for i in (1, 2, 3, 5, 8)]
    (files / "boards").mkdir()
    for i, photograph in enumerate(photographs):
        wider = np.array([[stretch if i > 2 else 1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        shown = cv2.warpAffine(photograph, wider, photograph.shape[1::-1])
        cv2.imwrite(str(files / "boards" / f"{i}.png"), shown)
    given = ("lens", files / "boards", "--corners", "9x6", "--square", "0.025")
    written = ("--out", files / "new.yaml", "--picture", files / "new.png")
    assert call(calibrate, monkeypatch, *given, *written) == 0
    assert ("the error is large" in capsys.readouterr().out) == (stretch > 1.0)


def test_calibrate_colours_proposes_ranges_in_which_the_fish_is_seen(
    files: Path, monkeypatch, capsys
) -> None:
    """The head's markers are dark blue and orange; the parameters' ranges fit neither."""
    names = {"front": "blue", "rear": "orange"}
    fish = discs_of_fish(0.5, 0.2, 1.0, (0.2, 0.0, -0.2))
    other = [(x, y, diameter, names.get(colour, colour)) for x, y, diameter, colour in fish]
    cv2.imwrite(str(files / "other.png"), draw(other))
    given = ("--lens", files / "lens.yaml", "--params", files / "params.yaml")
    assert (
        call(check_image, monkeypatch, files / "other.png", *given, "--out", files / "a.png") == 1
    )
    written = ("--out", files / "colours.yaml", "--picture", files / "colours.png")
    assert call(calibrate, monkeypatch, "colours", files / "other.png", *given, *written) == 0
    assert "fish found in 1 of 1 pictures" in capsys.readouterr().out
    config = config_from_file(files / "colours.yaml")
    tuned = replace(
        CONFIG, **{n: getattr(config, n) for n in vars(config) if n.endswith("_colour")}
    )
    found = Tracker(tuned, calibration()).track(cv2.imread(str(files / "other.png")), 0.0)
    assert isinstance(found, Detection)
    assert found.head.x == pytest.approx(0.5, abs=1e-3)
    assert cv2.imread(str(files / "colours.png")).shape == (720, 1280, 3)


@pytest.mark.parametrize("quality", [60, 75, 95])
def test_calibrate_colours_takes_the_pictures_that_a_camera_compresses(
    files: Path, monkeypatch, capsys, quality: int
) -> None:
    """JPEG smears the colours of the tail's markers, 2 pixels apart, into each other."""
    picture = draw(discs_of_fish(0.5, 0.2, 1.0, (0.2, 0.0, -0.2)))
    cv2.imwrite(str(files / "sent.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    given = ("--lens", files / "lens.yaml", "--params", files / "params.yaml")
    written = ("--out", files / "colours.yaml", "--picture", files / "colours.png")
    assert call(calibrate, monkeypatch, "colours", files / "sent.jpg", *given, *written) == 0
    assert "the tracker sees the fish in 1 of 1 pictures" in capsys.readouterr().out
    config = config_from_file(files / "colours.yaml")
    for marker, hue in (("front", 25), ("rear", 151), ("tail_odd", 3), ("tail_even", 61)):
        low, high = getattr(config, f"{marker}_colour")[:2]
        assert (hue - low) % 180 <= (high - low) % 180


def test_calibrate_colours_says_that_no_picture_shows_the_fish(
    files: Path, monkeypatch, capsys
) -> None:
    cv2.imwrite(str(files / "empty.png"), draw([]))
    given = ("--lens", files / "lens.yaml", "--params", files / "params.yaml")
    written = ("--out", files / "colours.yaml", "--picture", files / "colours.png")
    assert call(calibrate, monkeypatch, "colours", files / "empty.png", *given, *written) == 1
    assert "none of 1 pictures shows one fish" in capsys.readouterr().err
    assert not (files / "colours.yaml").exists()


class Visit:
    """A page of a picture of 40 x 30 pixels with the points a and b, and a browser."""

    def __init__(self) -> None:
        self.previews: list[Points] = []
        self.page = PickingPage(np.zeros((30, 40, 3), np.uint8), ["a", "b"], self._preview)
        self.points: Points = {}
        self._thread = threading.Thread(target=self._wait)
        self._thread.start()

    def _preview(self, points: Points) -> tuple[str, None]:
        self.previews.append(points)
        return f"{len(points)} set", None

    def _wait(self) -> None:
        self.points = self.page.wait()

    def ask(self, where: str, data: bytes | None = None, **headers: str) -> tuple[int, bytes]:
        request = urllib.request.Request(self.page.address + where, data, headers)
        try:
            with urllib.request.urlopen(request, timeout=30) as answer:
                return answer.status, answer.read()
        except urllib.error.HTTPError as error:
            return error.code, error.read()

    def finish(self) -> Points:
        if self._thread.is_alive():
            self.ask("done", json.dumps({"a": [1, 2], "b": [39.5, 29.5]}).encode())
        self._thread.join(30)
        return self.points


@pytest.fixture
def visit():
    made = Visit()
    yield made
    made.finish()


def test_the_points_that_were_clicked_come_back(visit: Visit) -> None:
    status, page = visit.ask("")
    assert status == 200
    assert b'const names = ["a", "b"]' in page
    assert visit.ask("picture.png")[1].startswith(b"\x89PNG")
    status, answer = visit.ask("preview", b'{"a": [3, 4.5]}')
    assert json.loads(answer) == {"text": "1 set", "picture": ""}
    assert visit.previews == [{"a": (3.0, 4.5)}]
    assert visit.finish() == {"a": (1.0, 2.0), "b": (39.5, 29.5)}


def test_connections_without_a_request_keep_nobody_waiting(visit: Visit) -> None:
    """Browsers open some in advance."""
    place = urllib.parse.urlsplit(visit.page.address)
    with (
        socket.create_connection((place.hostname, place.port)),
        socket.create_connection((place.hostname, place.port)),
    ):
        assert visit.ask("")[0] == 200
        assert visit.finish() == {"a": (1.0, 2.0), "b": (39.5, 29.5)}


def test_a_browser_that_goes_is_not_reported(visit: Visit, capfd) -> None:
    place = urllib.parse.urlsplit(visit.page.address)
    with socket.create_connection((place.hostname, place.port)) as gone:
        gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # a reset
    visit.finish()
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b"[]", b'{"c": [1, 2]}', b'{"a": [1]}', b'{"a": [1, NaN]}', b'{"a": [1, 99]}'],
)
def test_a_request_that_is_no_click_is_refused(visit: Visit, body: bytes) -> None:
    status, why = visit.ask("preview", body)
    assert status == 400
    assert why
    assert not visit.previews


def test_done_needs_every_point_and_another_host_is_refused(visit: Visit) -> None:
    assert visit.ask("done", b'{"a": [1, 2]}')[0] == 400
    assert visit.ask("", Host="example.org")[0] == 403
    assert visit.ask("elsewhere")[0] == 404
    assert not visit.points


def test_only_this_computer_reaches_the_page(visit: Visit) -> None:
    assert visit.page.address.startswith("http://127.0.0.1:")
