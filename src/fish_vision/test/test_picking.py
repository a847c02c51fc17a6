# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page on which a person clicks: requests that are no clicks are refused, and the points come back."""

import json
import threading
import urllib.error
import urllib.request

import numpy as np
import pytest

from fish_vision.verbs.pictures import PickingPage, Points


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
