# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Message bytes to pictures, and what is said of bytes that are none; robofish track: a video or a folder to poses."""

import argparse
import csv
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from pool_picture import CONFIG, calibration, discs_of_fish, draw
from pool_picture import SIZE as POOL_SIZE

from fish_report.errors import UserError
from fish_vision.calibration import lens_document
from fish_vision.picture import PictureError, frames, from_compressed, from_raw, to_jpeg
from fish_vision.verbs import track

SIZE = (32, 24)
PICTURE = cv2.GaussianBlur(
    np.random.default_rng(0).integers(0, 256, (24, 32, 3)).astype(np.uint8), (5, 5), 2
)

POSES = [(0.02 * k, 0.1, 0.3 + 0.05 * k) for k in range(6)]


def test_jpeg_goes_there_and_back() -> None:
    assert cv2.PSNR(from_compressed(to_jpeg(PICTURE, 95), SIZE), PICTURE) > 25.0


@pytest.mark.parametrize(
    ("encoding", "channels"),
    [("bgr8", [0, 1, 2]), ("rgb8", [2, 1, 0]), ("bgra8", [0, 1, 2, 0]), ("rgba8", [2, 1, 0, 0])],
)
def test_raw_encodings_and_padded_rows(encoding: str, channels: list[int]) -> None:
    step = 32 * len(channels) + 8
    rows = np.zeros((24, step), np.uint8)
    rows[:, : 32 * len(channels)] = PICTURE[..., channels].reshape(24, -1)
    np.testing.assert_array_equal(from_raw(rows.tobytes(), encoding, 32, 24, step, SIZE), PICTURE)


def test_yuyv_grey_is_grey() -> None:
    data = np.tile(np.array([120, 128], np.uint8), 32 * 24).tobytes()
    picture = from_raw(data, "yuv422_yuy2", 32, 24, 64, SIZE)
    assert picture.shape == (24, 32, 3)
    assert np.ptp(picture) <= 1


def test_yuyv_keeps_its_colours() -> None:
    """Studio-range BT.601, bytes Y U Y V: swapped U and V would make red blue."""
    red, blue = bytes([82, 90, 82, 240]), bytes([41, 240, 41, 110])
    picture = from_raw(red * 16 + blue * 16, "yuv422_yuy2", 64, 1, 128, (64, 1)).astype(int)
    assert np.abs(picture[0, :32] - (0, 0, 255)).max() < 8
    assert np.abs(picture[0, 32:] - (255, 0, 0)).max() < 8


def test_odd_width_is_refused_only_where_two_pixels_share_a_colour() -> None:
    odd = PICTURE[:, :31]
    np.testing.assert_array_equal(from_raw(odd.tobytes(), "bgr8", 31, 24, 93, (31, 24)), odd)
    with pytest.raises(PictureError, match="width 17: expected an even one"):
        from_raw(bytes(34 * 4), "yuv422_yuy2", 17, 4, 34, (17, 4))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "0 bytes"),
        (b"hello", "no JPEG"),
        (to_jpeg(PICTURE)[:400], "cut off"),
        (b"\xff\xd8" + bytes(500) + b"\xff\xd9", "broken"),
    ],
)
def test_broken_jpeg_is_refused_with_the_reason(data: bytes, message: str) -> None:
    with pytest.raises(PictureError, match=message):
        from_compressed(data, SIZE)


def test_a_padded_jpeg_is_taken_and_an_early_end_marker_hides_no_cut() -> None:
    data = to_jpeg(PICTURE)
    np.testing.assert_array_equal(
        from_compressed(data + bytes(60), SIZE), from_compressed(data, SIZE)
    )
    with_thumbnail = data[:100] + b"\xff\xd9" + data[100:300]
    with pytest.raises(PictureError, match="cut off after 302 bytes"):
        from_compressed(with_thumbnail, SIZE)


def test_a_picture_of_another_size_is_refused() -> None:
    with pytest.raises(PictureError, match="32 x 24, but camera_info says 64 x 48"):
        from_compressed(to_jpeg(PICTURE), (64, 48))


def test_the_size_is_judged_before_a_picture_is_unpacked(monkeypatch: pytest.MonkeyPatch) -> None:
    wide = cv2.imencode(".png", np.zeros((1, 9000, 3), np.uint8))[1].tobytes()
    turned = to_jpeg(np.ascontiguousarray(PICTURE.transpose(1, 0, 2)))
    unpacked = []
    monkeypatch.setattr(cv2, "imdecode", lambda *_: unpacked.append(1))
    for data, size, said in (
        (wide, SIZE, "9000 x 1, but camera_info says 32 x 24"),
        (wide, None, "9000 x 1: expected at most 8192 x 8192"),
        (to_jpeg(PICTURE), (64, 48), "32 x 24, but camera_info says 64 x 48"),
    ):
        with pytest.raises(PictureError, match=said):
            from_compressed(data, size)
    assert not unpacked
    monkeypatch.undo()
    with pytest.raises(PictureError, match="24 x 32, but camera_info says 32 x 24"):
        from_compressed(turned, SIZE)


def test_pictures_without_loss_are_taken() -> None:
    png = cv2.imencode(".png", PICTURE)[1].tobytes()
    np.testing.assert_array_equal(from_compressed(png, SIZE), PICTURE)
    np.testing.assert_array_equal(from_compressed(png, None), PICTURE)


@pytest.mark.parametrize(
    ("encoding", "width", "step", "message"),
    [
        ("mono8", 32, 32, "mono8"),
        ("bgr8", 32, 90, "rows of 90"),
        ("bgr8", 40, 120, "bytes"),
        ("bgr8", 0, 0, "0 x 24"),
    ],
)
def test_raw_images_that_do_not_add_up_are_refused(
    encoding: str, width: int, step: int, message: str
) -> None:
    with pytest.raises(PictureError, match=message):
        from_raw(PICTURE.tobytes(), encoding, width, 24, step, SIZE)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """Folder with lens.yaml, params.yaml and frames/ that show POSES after one empty picture."""
    lens = lens_document(calibration().lens, "overhead")
    (tmp_path / "lens.yaml").write_text(yaml.safe_dump(lens))
    mount = {
        "camera_position": list(CONFIG.camera_position),
        "camera_tilt": list(CONFIG.camera_tilt),
    }
    (tmp_path / "params.yaml").write_text(yaml.safe_dump({"/**": {"ros__parameters": mount}}))
    (tmp_path / "frames").mkdir()
    pictures = [draw([]), *(draw(discs_of_fish(*pose)) for pose in POSES)]
    for k, picture in enumerate(pictures):
        cv2.imwrite(str(tmp_path / "frames" / f"{k:03d}.png"), picture)
    return tmp_path


def run(files: Path, source: str, *more: str) -> int:
    parser = argparse.ArgumentParser()
    track.add_arguments(parser)
    given = ["--lens", str(files / "lens.yaml"), "--params", str(files / "params.yaml")]
    written = ["--out", str(files / "poses.csv"), "--picture", str(files / "tracked.png")]
    return track.run(parser.parse_args([str(files / source), *given, *written, *more]))


def rows(files: Path) -> list[dict[str, str]]:
    with (files / "poses.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_no_input_of_the_tracker_is_replaced(files: Path) -> None:
    for option, name in (
        ("--out", "lens.yaml"),
        ("--out", "params.yaml"),
        ("--picture", "frames/001.png"),
    ):
        before = (files / name).read_bytes()
        with pytest.raises(UserError, match=f"{option}: .*{name} is the input"):
            run(files, "frames", "--rate", "20", option, str(files / name))
        assert (files / name).read_bytes() == before


def test_a_folder_of_pictures_gives_poses_in_time(files: Path, capsys) -> None:
    assert run(files, "frames", "--rate", "20") == 0
    found = rows(files)
    np.testing.assert_allclose([float(r["t"]) for r in found], np.arange(1, 7) / 20)
    poses = [[float(r[name]) for name in ("x", "y", "heading")] for r in found]
    np.testing.assert_allclose(poses, POSES, atol=5e-3)
    printed = capsys.readouterr().out
    assert "fish seen in 6 of 7 frames" in printed
    assert "lost in 1: no front marker" in printed
    assert cv2.imread(str(files / "tracked.png")).shape[1::-1] == POOL_SIZE


def test_a_video_file_brings_its_own_rate(files: Path) -> None:
    video = cv2.VideoWriter(
        str(files / "fish.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, POOL_SIZE
    )
    for pose in POSES:
        video.write(draw(discs_of_fish(*pose)))
    video.release()
    assert run(files, "fish.avi") == 0
    found = rows(files)
    np.testing.assert_allclose([float(r["t"]) for r in found], np.arange(6) / 25)
    np.testing.assert_allclose([float(r["x"]) for r in found], [p[0] for p in POSES], atol=1e-3)


def test_a_frozen_stretch_gives_no_poses_of_a_time_that_it_does_not_show(
    files: Path, capsys
) -> None:
    pictures = sorted((files / "frames").iterdir())
    for k in range(3):  # the third pose stays for three more frames
        shutil.copy(pictures[3], files / "frames" / f"003_{k}.png")
    assert run(files, "frames", "--rate", "20") == 0
    times = [round(20 * float(r["t"])) for r in rows(files)]
    assert times == [1, 2, 3, 7, 8, 9]
    assert f"lost in 3: {track.REPEATED}" in capsys.readouterr().out


def test_a_video_without_the_fish_ends_with_status_1(files: Path, capsys) -> None:
    for file in sorted((files / "frames").iterdir())[1:]:
        file.unlink()
    assert run(files, "frames", "--rate", "20") == 1
    assert "fish seen in 0 of 1 frames" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("source", "more", "said"),
    [
        ("nothing.avi", (), "no such video or folder"),
        ("lens.yaml", (), "not a video"),
        ("frames", (), "expected --rate"),
        ("frames", ("--rate", "nan"), "expected a positive number"),
        ("empty", ("--rate", "20"), "no pictures in it"),
        ("small", ("--rate", "20"), "the lens file says"),
    ],
)
def test_what_is_no_video_of_this_camera_is_said(
    files: Path, source: str, more: tuple[str, ...], said: str
) -> None:
    (files / "empty").mkdir()
    (files / "small").mkdir()
    cv2.imwrite(str(files / "small" / "1.png"), np.zeros((20, 30, 3), np.uint8))
    with pytest.raises(UserError, match=said):
        run(files, source, *more)


def test_poses_of_before_stay_where_the_new_ones_are_refused(files: Path) -> None:
    assert run(files, "frames", "--rate", "20") == 0
    before = rows(files)
    cv2.imwrite(str(files / "frames" / "999.png"), np.zeros((20, 30, 3), np.uint8))
    with pytest.raises(UserError, match="the lens file says"):
        run(files, "frames", "--rate", "20")
    assert rows(files) == before


@pytest.mark.parametrize(("rate", "refused"), [(None, True), (25.0, False)])
def test_a_video_whose_rate_varies_has_no_times_by_counting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rate: float | None, refused: bool
) -> None:
    class Varying:
        """Six frames, the last three after a pause of 0.2 s."""

        def __init__(self, _: str) -> None:
            self.count = 0

        def isOpened(self) -> bool:
            return True

        def get(self, what: int) -> float:
            if what == cv2.CAP_PROP_FPS:
                return 25.0
            return 40.0 * (self.count - 1) + 200.0 * (self.count > 3)

        def read(self) -> tuple[bool, np.ndarray]:
            self.count += 1
            return self.count <= 6, np.zeros((*POOL_SIZE[::-1], 3), np.uint8)

        def release(self) -> None:
            pass

    (tmp_path / "fish.mp4").touch()
    monkeypatch.setattr(cv2, "VideoCapture", Varying)
    got = frames(tmp_path / "fish.mp4", rate, POOL_SIZE)
    if refused:
        with pytest.raises(PictureError, match=r"frame 3 comes \+5 frames off a constant 25"):
            list(got)
    else:
        assert [time for time, _ in got] == pytest.approx(np.arange(6) / 25.0)


def test_a_low_pass_delays_the_poses_and_says_so(files: Path) -> None:
    """The fish of POSES moves steadily: a pose is right at its own time."""
    text = (files / "params.yaml").read_text() + "    lowpass_hz: 3.0\n"
    (files / "params.yaml").write_text(text)
    assert run(files, "frames", "--rate", "20") == 0
    found = rows(files)
    assert float(found[-1]["t"]) < 6 / 20 - 0.02
    for row in found:
        frame = 20 * float(row["t"]) - 1
        expected = [0.02 * frame, 0.1, 0.3 + 0.05 * frame]
        values = [float(row[name]) for name in ("x", "y", "heading")]
        np.testing.assert_allclose(values, expected, atol=5e-3)
