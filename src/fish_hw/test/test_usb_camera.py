# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The camera: capture from a video file, device, JPEG handling, calibration files."""

import os
import threading

import cv2
import numpy as np
import pytest
from fakes import wait_until

from fish_hw.devices import usb_camera
from fish_hw.devices.reconnect import ERROR, OK, WARN, Loss
from fish_hw.devices.usb_camera import UsbCamera, decode_jpeg, encode_jpeg
from fish_hw.emulators.walking_square import WalkingSquare
from fish_hw.settings import CameraSettings
from fish_hw.transport.interfaces import PortUnavailable
from fish_hw.transport.video_capture import Frame, VideoCapture, compressed_frame
from fish_node.file_head import jpeg_size

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
        CameraSettings(device="emulator", width=64, height=48, exposure_delay_s=0.02),
        lambda: source,
        Clock(),
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


def test_a_picture_that_stands_still_is_not_sent_on_and_is_named():
    clock = Clock()
    source = Source(clock)
    settings = CameraSettings(device="/dev/video0", width=64, height=48)
    camera = UsbCamera(settings, lambda: source, clock)
    camera.connect()
    source.frames = [Frame(clock.now, image=picture() + np.uint8(k)) for k in range(10)]
    assert sum(camera.step().picture is not None for _ in range(10)) == 10
    source.frames = [Frame(clock.now + k, image=picture()) for k in range(60)]  # new stamps
    sent = [camera.step() for _ in range(20)]
    assert sum(cycle.picture is not None for cycle in sent) == 1
    status = camera.status()
    assert (status.level, status.message) == (ERROR, "the picture stands still: not sent on")
    events = [event for _ in range(20) for event in camera.step().events]
    assert events == ["camera /dev/video0: the picture stands still for 1.0 s"]


def test_status_follows_the_rate(bench):
    camera, source, clock = bench
    source.frames = [Frame(clock.now, image=picture()) for _ in range(90)]
    for _ in range(60):
        camera.step()
    status = camera.status()
    assert (status.level, status.values["rate [Hz]"], status.values["frames"]) == (OK, 30.0, 60)
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
    assert source.closed
    assert not camera.connected
    assert camera.status().level == ERROR
    assert camera.missed == 31
    assert isinstance(events[0], Loss)
    camera.close()  # of nothing
    clock.sleep(1.0)
    camera.step()  # opens it
    source.frames = [Frame(clock.now, image=picture())]
    cycle = camera.step()
    assert cycle.picture is not None
    assert cycle.events == ["camera connected again"]
    assert camera.connected


def test_camera_that_opens_but_sends_nothing_is_lost_once(bench):
    camera, source, clock = bench
    events = []

    def run(duration_s: float) -> None:
        end = clock.now + duration_s
        while clock.now < end:
            clock.sleep(0.01)
            events.extend(camera.step().events)

    lost, found = "camera emulator: no frames for 1.0 s", "camera connected again"
    run(30.0)
    assert events == [lost]
    assert 4 <= camera.status().values["reconnect attempts"] <= 8  # waits grow to 5 s
    source.frames = [Frame(clock.now, image=picture())]
    run(30.0)
    assert events == [lost, found, lost]  # a second loss for the same reason is said too


def test_a_camera_is_not_released_in_the_middle_of_a_read(bench, monkeypatch):
    camera, source, _ = bench
    reading, go_on = threading.Event(), threading.Event()

    def stalled() -> None:
        reading.set()
        go_on.wait()

    source.read = stalled
    worker = threading.Thread(target=camera.step)
    worker.start()
    assert reading.wait(5.0)
    monkeypatch.setattr(usb_camera, "CLOSE_WAIT_S", 0.01)
    camera.close()
    assert not source.closed
    monkeypatch.setattr(usb_camera, "CLOSE_WAIT_S", 5.0)
    closer = threading.Thread(target=camera.close)
    closer.start()
    go_on.set()
    assert wait_until(lambda: source.closed)
    worker.join()
    closer.join()


@pytest.fixture
def video(tmp_path):
    """A video file of five frames that grow brighter."""
    path = str(tmp_path / "pool.avi")
    writer = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (64, 48))
    for i in range(5):
        writer.write(np.full((48, 64, 3), 40 * i, np.uint8))
    writer.release()
    return path


@pytest.mark.parametrize("chosen", [{}, {"exposure": 100, "focus": 10, "white_balance_k": 4000}])
def test_a_device_is_configured_through_the_real_opencv(video, monkeypatch, chosen):
    """A file stands in for the device: OpenCV checks types, and what a file cannot do it ignores."""
    opened = []
    real = cv2.VideoCapture

    def capture(device: str, api: int) -> cv2.VideoCapture:
        opened.append((device, api, os.environ["OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT"]))
        return real(video)

    monkeypatch.delenv("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", raising=False)
    monkeypatch.setattr(cv2, "VideoCapture", capture)
    camera = VideoCapture(CameraSettings(device="/dev/video0", **chosen))
    camera.close()
    assert opened == [
        ("/dev/video0", cv2.CAP_V4L2, "1")
    ]  # s that a silent camera may block, not 10


class Device:
    """A V4L2 camera as OpenCV shows it: keeps what is set, shows one picture."""

    def __init__(self, frame: np.ndarray) -> None:
        self.frame = frame
        self.values: dict[int, float] = {}

    def isOpened(self) -> bool:
        return True

    def set(self, key: int, value: float) -> None:
        self.values[key] = value

    def get(self, key: int) -> float:
        return self.values.get(key, 0.0)

    def grab(self) -> bool:
        return True

    def retrieve(self) -> tuple[bool, np.ndarray]:
        return True, self.frame


def opened(monkeypatch, device: Device, **chosen) -> VideoCapture:
    monkeypatch.setattr(cv2, "VideoCapture", lambda *_: device)
    return VideoCapture(CameraSettings(device="/dev/video0", **chosen), clock=lambda: 50.0)


FORMAT = {
    cv2.CAP_PROP_FOURCC: cv2.VideoWriter.fourcc(*"MJPG"),
    cv2.CAP_PROP_FRAME_WIDTH: 640,
    cv2.CAP_PROP_FRAME_HEIGHT: 480,
    cv2.CAP_PROP_FPS: 60.0,
    cv2.CAP_PROP_BUFFERSIZE: 1,
    cv2.CAP_PROP_CONVERT_RGB: 0,
}
AUTOMATIC = {cv2.CAP_PROP_AUTO_EXPOSURE: 3, cv2.CAP_PROP_AUTOFOCUS: 1, cv2.CAP_PROP_AUTO_WB: 1}
BY_HAND = {  # automatic exposure is 3 in V4L2, exposure by hand 1
    cv2.CAP_PROP_AUTO_EXPOSURE: 1,
    cv2.CAP_PROP_EXPOSURE: 100,
    cv2.CAP_PROP_AUTOFOCUS: 0,
    cv2.CAP_PROP_FOCUS: 0,
    cv2.CAP_PROP_AUTO_WB: 0,
    cv2.CAP_PROP_WB_TEMPERATURE: 4000,
}


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [({}, AUTOMATIC), ({"exposure": 100, "focus": 0, "white_balance_k": 4000}, BY_HAND)],
    ids=["automatic", "by hand"],
)
def test_a_device_gets_format_size_and_what_was_chosen(monkeypatch, chosen, expected):
    device = Device(picture())
    opened(monkeypatch, device, width=640, height=480, rate_hz=60.0, **chosen)
    assert device.values == FORMAT | expected
    # the format decides on the sizes, an automatic mode on whether a value is taken
    assert [key for key in device.values if key in FORMAT | expected] == [*FORMAT, *expected]


@pytest.mark.parametrize(
    ("stamp_s", "time_s"), [(49.98, 49.98), (49.0, 50.0), (50.1, 50.0), (0.0, 50.0)], ids=str
)
def test_a_frame_has_the_drivers_stamp_if_it_is_believable(monkeypatch, stamp_s, time_s):
    device = Device(picture())
    capture = opened(monkeypatch, device)
    device.values[cv2.CAP_PROP_POS_MSEC] = 1000 * stamp_s
    frame = capture.read()
    assert frame.time_s == pytest.approx(time_s)
    assert frame.image is device.frame


def test_the_jpeg_of_a_device_is_not_decoded(monkeypatch):
    jpeg = encode_jpeg(picture(), 90)
    frame = opened(monkeypatch, Device(np.frombuffer(jpeg, np.uint8)[None])).read()
    assert frame.jpeg == jpeg
    assert frame.image is None


def test_a_damaged_frame_of_a_device_is_none(monkeypatch):
    device = Device(picture())
    capture = opened(monkeypatch, device)
    for damaged in (
        lambda: (False, device.frame),
        lambda: (True, None),
        lambda: cv2.cvtColor(None, 0),
    ):
        device.retrieve = damaged
        assert capture.read() is None


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


def test_video_file_is_played_in_a_loop_at_its_pace(video):
    clock = Clock()
    capture = VideoCapture(CameraSettings(device=video, rate_hz=30.0), clock, clock.sleep)
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
    progressive = cv2.imencode(".jpg", picture(*size), [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1]
    assert jpeg_size(progressive.tobytes()) == size


def test_jpeg_size_of_damaged_data():
    jpeg = encode_jpeg(picture(), 90)
    for cut in range(0, len(jpeg), 7):
        jpeg_size(jpeg[:cut])
    assert jpeg_size(b"") is None
    assert jpeg_size(b"\xff\xd8" + bytes(50)) is None
    assert jpeg_size(b"\xff\xd8\xff\xe0\x00\x00" * 5) is None  # a segment of length 0


@pytest.mark.parametrize("size", [(0xFFFF, 0xFFFF), (0x8000 | 48, 0x8000 | 64), (48, 0x4000 | 64)])
def test_a_header_with_a_bit_error_in_the_size_is_no_picture(size):
    """Of the first two OpenCV says with an exception that it takes no more than 2^30 pixels; the third it would unpack."""
    jpeg = encode_jpeg(picture(), 90)
    at = jpeg.index(b"\xff\xc0") + 5
    height, width = size
    damaged = jpeg[:at] + height.to_bytes(2, "big") + width.to_bytes(2, "big") + jpeg[at + 4 :]
    assert jpeg_size(damaged) == (width, height)
    assert decode_jpeg(damaged) is None
    assert decode_jpeg(jpeg) is not None


def test_walking_square_walks():
    clock = Clock()
    source = WalkingSquare(SETTINGS, clock, clock.sleep)
    first, second = source.read(), source.read()
    assert first.image.shape == (48, 64, 3)
    assert (first.image != second.image).any()
    assert second.time_s - first.time_s == pytest.approx(1 / 30)
