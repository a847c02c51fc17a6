"""The camera: capture from a video file, device, JPEG handling, calibration files."""

import cv2
import numpy as np
import pytest
import yaml

from fish_hw.devices.camera_calibration import CalibrationError, read_calibration
from fish_hw.devices.status import ERROR, OK, WARN
from fish_hw.devices.usb_camera import UsbCamera, decode_jpeg, encode_jpeg, jpeg_size
from fish_hw.emulators.walking_square import WalkingSquare
from fish_hw.settings.camera import CameraSettings
from fish_hw.transport.errors import PortUnavailable
from fish_hw.transport.video_capture import Frame, VideoCapture, compressed_frame

SETTINGS = CameraSettings(device="emulator", width=64, height=48)


class Clock:
    def __init__(self) -> None:
        self.now = 10.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, duration_s: float) -> None:
        self.now += duration_s


class Source:
    """Returns what the test queues; silent when the queue is empty."""

    def __init__(self, clock: Clock) -> None:
        self.clock, self.frames, self.closed = clock, [], False

    def read(self) -> Frame | None:
        self.clock.sleep(1 / 30)
        return self.frames.pop(0) if self.frames else None

    def close(self) -> None:
        self.closed = True


def picture(width: int = 64, height: int = 48) -> np.ndarray:
    image = np.full((height, width, 3), 60, np.uint8)
    image[: height // 2, : width // 2] = (0, 0, 250)
    return image


@pytest.fixture
def bench():
    clock = Clock()
    source = Source(clock)
    camera = UsbCamera(SETTINGS, lambda: source, clock)
    camera.connect()
    return camera, source, clock


def test_image_becomes_jpeg_with_its_time(bench):
    camera, source, _ = bench
    source.frames = [Frame(9.5, image=picture())]
    got = camera.step().picture
    assert (got.time_s, got.width, got.height) == (9.5, 64, 48)
    decoded = decode_jpeg(got.jpeg)
    assert abs(decoded.astype(int) - picture()).mean() < 5


def test_jpeg_of_the_camera_is_passed_through(bench):
    camera, source, _ = bench
    jpeg = encode_jpeg(picture(), 90)
    source.frames = [Frame(9.5, jpeg=jpeg)]
    assert camera.step().picture.jpeg is jpeg


def test_exposure_delay_is_taken_off():
    camera = UsbCamera(
        CameraSettings(device="emulator", width=64, height=48, exposure_delay_s=0.02), lambda: source, Clock()
    )
    source = Source(Clock())
    source.frames = [Frame(9.5, image=picture())]
    camera.connect()
    assert camera.step().picture.time_s == pytest.approx(9.48)


def test_jpeg_without_a_size_is_dropped(bench):
    camera, source, _ = bench
    source.frames = [Frame(9.5, jpeg=b"\xff\xd8\xff\xd9")]
    assert camera.step().picture is None
    assert camera.missed == 1


def test_status_follows_the_rate(bench):
    camera, source, clock = bench
    source.frames = [Frame(clock.now, image=picture()) for _ in range(60)]
    for _ in range(30):
        camera.step()
    assert camera.status().level == OK
    for _ in range(5):
        camera.step()
    clock.sleep(1.0)
    assert (camera.status().level, camera.status().level) == (WARN, ERROR)


def test_wrong_size_is_said(bench):
    camera, source, clock = bench
    source.frames = [Frame(clock.now, image=picture(32, 24)) for _ in range(30)]
    for _ in range(30):
        camera.step()
    status = camera.status()
    assert (status.level, status.message) == (WARN, "frames are 32x24 px instead of 64x48")


def test_camera_that_stops_is_opened_again(bench):
    camera, source, clock = bench
    events = [e for _ in range(40) for e in camera.step().events]
    assert events == ["camera emulator: no frames for 1.0 s"]
    assert source.closed and camera.status().level == ERROR
    clock.sleep(1.0)
    assert camera.step().events == ["camera connected again"]
    source.frames = [Frame(clock.now, image=picture())]
    assert camera.step().picture is not None


def test_absent_camera_names_it_and_the_others():
    with pytest.raises(
        PortUnavailable, match="cannot open camera /dev/video77: there is no such device or file"
    ):
        VideoCapture(CameraSettings(device="/dev/video77"))


def test_file_that_is_no_video(tmp_path):
    path = tmp_path / "notes.avi"
    path.write_text("no video")
    with pytest.raises(PortUnavailable, match="or it is no video"):
        VideoCapture(CameraSettings(device=str(path)))


def test_video_file_is_played_in_a_loop_at_its_pace(tmp_path):
    path = str(tmp_path / "pool.avi")
    writer = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (64, 48))
    for i in range(5):
        writer.write(np.full((48, 64, 3), 40 * i, np.uint8))
    writer.release()
    clock = Clock()
    capture = VideoCapture(CameraSettings(device=path, rate_hz=30.0), clock, clock.sleep)
    frames = [frame for _ in range(12) if (frame := capture.read()) is not None]
    capture.close()
    brightness = [round(frame.image.mean() / 40) for frame in frames]
    assert brightness == [0, 1, 2, 3, 4, 0, 1, 2, 3, 4]
    steps = np.diff([frame.time_s for frame in frames])
    assert steps == pytest.approx(np.full(9, 1 / 30), abs=1e-6)


def test_camera_jpeg_is_trimmed_and_checked():
    jpeg = encode_jpeg(picture(), 90)
    assert compressed_frame(1.0, jpeg + bytes(100)).jpeg == jpeg
    assert compressed_frame(1.0, jpeg[:-10]) is None
    assert compressed_frame(1.0, b"YUYV" * 10) is None


@pytest.mark.parametrize("size", [(64, 48), (1280, 720), (17, 33)])
def test_jpeg_size(size):
    assert jpeg_size(encode_jpeg(picture(*size), 90)) == size


def test_jpeg_size_of_damaged_data():
    jpeg = encode_jpeg(picture(), 90)
    for cut in range(0, len(jpeg), 7):
        jpeg_size(jpeg[:cut])
    assert jpeg_size(b"") is None
    assert jpeg_size(b"\xff\xd8" + bytes(50)) is None
    assert jpeg_size(b"\xff\xd8\xff\xe0\x00\x00" * 5) is None  # a segment of length 0


def test_walking_square_walks():
    clock = Clock()
    source = WalkingSquare(SETTINGS, clock, clock.sleep)
    first, second = source.read(), source.read()
    assert first.image.shape == (48, 64, 3)
    assert (first.image != second.image).any()
    assert second.time_s - first.time_s == pytest.approx(1 / 30)


CALIBRATION = {
    "image_width": 1280,
    "image_height": 720,
    "camera_name": "overhead",
    "camera_matrix": {"rows": 3, "cols": 3, "data": [900.0, 0, 640, 0, 900, 360, 0, 0, 1]},
    "distortion_model": "plumb_bob",
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": [-0.2, 0.05, 0, 0, 0]},
    "rectification_matrix": {"rows": 3, "cols": 3, "data": [1, 0, 0, 0, 1, 0, 0, 0, 1]},
    "projection_matrix": {"rows": 3, "cols": 4, "data": [900, 0, 640, 0, 0, 900, 360, 0, 0, 0, 1, 0]},
}


def written(tmp_path, document) -> object:
    path = tmp_path / "camera.yaml"
    path.write_text(document if isinstance(document, str) else yaml.safe_dump(document))
    return path


def test_calibration(tmp_path):
    calibration = read_calibration(written(tmp_path, CALIBRATION))
    assert (calibration.width, calibration.height) == (1280, 720)
    assert calibration.camera_matrix[2] == 640.0
    assert calibration.distortion == (-0.2, 0.05, 0.0, 0.0, 0.0)
    assert len(calibration.projection) == 12


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"image_width": "wide"}, "image_width is 'wide', expected a number of pixels"),
        ({"camera_matrix": {"data": [1, 2]}}, r"camera_matrix.data is \[1, 2\], expected 9 numbers"),
        ({"camera_matrix": 3}, "camera_matrix.data is None, expected 9 numbers"),
        ({"distortion_model": "fancy"}, "distortion_model is 'fancy', expected one of plumb_bob"),
    ],
)
def test_calibration_errors_name_the_field(tmp_path, change, expected):
    with pytest.raises(CalibrationError, match=expected):
        read_calibration(written(tmp_path, CALIBRATION | change))


@pytest.mark.parametrize("text", ["", "[1, 2]", "{bad: [", "a: b: c"])
def test_files_that_are_no_calibration(tmp_path, text):
    with pytest.raises(CalibrationError, match="camera.yaml"):
        read_calibration(written(tmp_path, text))


def test_missing_field_and_missing_file(tmp_path):
    with pytest.raises(CalibrationError, match="projection_matrix is missing"):
        read_calibration(
            written(tmp_path, {k: v for k, v in CALIBRATION.items() if k != "projection_matrix"})
        )
    with pytest.raises(CalibrationError, match="No such file"):
        read_calibration(tmp_path / "nowhere.yaml")
