# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""JSON files, the terminal, and the pool of workers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from fish_report.errors import UserError
from fish_report.files import (
    read_yaml,
    unique_names,
    writable_file,
    writable_folder,
    write_json,
)
from fish_report.page import Table, write_page
from fish_report.parallel import at_end_of_worker, worker_pool
from fish_report.printable import LONGEST
from fish_report.terminal import print_table, say, terminal


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"a: 1\nb:\n  c: 1\n  d: 2\n  c: 3", "c is given twice in the table of line 3"),
        (b"a: [1", "cannot be read as YAML: while parsing"),
        (b"a: \xff", "cannot be read as YAML: 'utf-8' codec"),
        (b"[" * 20_000, "its tables are nested too deeply"),
        (b"[1, 2]: 3", "cannot be read as YAML: while constructing a mapping"),
        (None, "cannot be read: No such file"),
    ],
)
def test_what_is_wrong_with_a_yaml_file_is_one_error(tmp_path, text, message):
    file = tmp_path / "f.yaml"
    if text is not None:
        file.write_bytes(text)
    with pytest.raises(ValueError, match=message):
        read_yaml(file)


def test_a_yaml_file_may_merge_one_table_into_another(tmp_path):
    file = tmp_path / "f.yaml"
    file.write_text("a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}\n")
    assert read_yaml(file) == {"a": {"x": 1, "y": 2}, "b": {"x": 1, "y": 3}}


def test_a_table_of_json_has_no_two_entries_of_one_name():
    assert json.loads('{"a": {"b": 1}, "b": 2}', object_pairs_hook=unique_names)["b"] == 2
    with pytest.raises(ValueError, match=r"^b is given twice in one table; keep one of the two$"):
        json.loads('[{"a": {"b": 1, "b": 1}}]', object_pairs_hook=unique_names)


def test_a_result_replaces_no_input(tmp_path):
    robot, link = tmp_path / "robot.yaml", tmp_path / "link.yaml"
    robot.write_text("format: 1")
    link.symlink_to(robot)
    inputs = (None, tmp_path / "nowhere", tmp_path, robot)
    for file in (robot, link, tmp_path / "new" / ".." / "robot.yaml"):
        (tmp_path / "new").mkdir(exist_ok=True)
        with pytest.raises(UserError) as refused:
            writable_file(file, "--html", inputs)
        assert str(refused.value) == (
            f"--html: {file} is the input {robot}, which the result would replace; expected another "
            "place, choose another --html"
        )
    with pytest.raises(UserError, match=r"robot.yaml is the input .*choose another --out"):
        writable_folder(tmp_path, names=("report.html", "robot.yaml"), inputs=inputs)
    assert writable_folder(tmp_path, names=("model.yaml",), inputs=inputs) == tmp_path
    assert writable_file(tmp_path / "a" / "model.yaml", inputs=inputs).parent.is_dir()


def test_outputs_of_one_stem_do_not_share_a_draft(tmp_path):
    (tmp_path / "a.part").write_text("mine")
    write_json(tmp_path / "a.json", 1)
    assert (tmp_path / "a.part").read_text() == "mine"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.json", "a.part"]


def test_private_content_is_never_open_to_others(tmp_path, monkeypatch):
    modes = []
    replace = os.replace

    def watched(part, path):
        modes.append(part.stat().st_mode & 0o777)
        replace(part, path)

    monkeypatch.setattr(os, "replace", watched)
    monkeypatch.setattr(Path, "chmod", lambda *_: pytest.fail("too late"))
    (tmp_path / "a.json.part").write_text("of an earlier run, open to all")
    write_json(tmp_path / "a.json", 1, private=True)
    assert modes == [0o600]
    assert (tmp_path / "a.json").stat().st_mode & 0o777 == 0o600


def test_a_page_that_cannot_be_written_leaves_the_earlier_one(tmp_path, monkeypatch):
    page = tmp_path / "page.html"
    page.write_text("earlier")
    link = tmp_path / "link.html"
    link.symlink_to(page)
    with monkeypatch.context() as patched:
        patched.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError("disk full")))
        with pytest.raises(OSError, match="disk full"):
            write_page(page, "title", "lead", [])
    assert page.read_text() == "earlier"
    write_page(link, "title", "lead \udcff", [])
    assert link.is_symlink()
    assert "lead \\udcff" in page.read_text()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["link.html", "page.html"]
    write_page(Path(os.devnull), "title", "lead", [])
    assert not Path(os.devnull).is_file()


def test_what_is_not_finite_is_null_and_all_else_stays(tmp_path):
    content = {
        "a": [1, 2.5, np.float64(-np.inf), float("nan")],
        "b": np.array([[1.0, np.nan]]),
        "c": (True, None, "x", np.int64(3), np.bool_(True)),
        "d": {"e": -0.5},
    }
    write_json(tmp_path / "f.json", content)
    text = (tmp_path / "f.json").read_text()
    assert text.endswith("}\n")
    assert json.loads(text) == {
        "a": [1, 2.5, None, None],
        "b": [[1.0, None]],
        "c": [True, None, "x", 3, True],
        "d": {"e": -0.5},
    }


HOSTILE = (
    "[/x] a closing tag",
    "[bold]not bold[/bold]",
    "\x1b[31mred\x1b[0m",
    "bell \x07",
    "two\nlines",
)


@pytest.fixture
def console() -> Console:
    """As the verbs have it, written to a text."""
    result = terminal()
    result.file = StringIO()
    return result


def written(console: Console) -> str:
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize("text", HOSTILE)
def test_a_line_shows_every_character(console: Console, text: str) -> None:
    say(console, text)
    line = written(console)
    assert line.count("\n") == 1
    assert "\x1b" not in line
    assert "\x07" not in line
    assert line.startswith(
        text[:2] if text.isprintable() else text.encode("unicode_escape").decode()[:5]
    )


@pytest.mark.parametrize("text", HOSTILE)
def test_a_table_shows_every_character(console: Console, text: str) -> None:
    print_table(console, Table(text, [text, "number"], [[text, "1"]], text.replace("\n", " ")))
    shown = written(console)
    assert "\x1b" not in shown
    assert "\x07" not in shown
    if text.startswith("["):
        assert shown.count(text) == 4


def test_the_console_of_the_verbs_knows_no_markup(console: Console) -> None:
    console.print("[/x] [red]text[/red]")
    assert written(console) == "[/x] [red]text[/red]\n"


def test_a_long_text_is_cut(console: Console) -> None:
    say(console, "a" * 1_000_000)
    assert LONGEST < len(written(console)) < 2 * LONGEST


_started: list[subprocess.Popen[bytes]] = []


def kill_what_was_started() -> None:
    at_end_of_worker(lambda: [process.kill() for process in _started])


def comes_true(condition: Callable[[], object], patience: float = 120.0) -> bool:
    end = time.monotonic() + patience
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return bool(condition())


def has_ended(pid: int) -> bool:
    """No such process, or one that nobody has waited for yet."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


def square(number: int) -> int:
    return number * number


def wait_for_a_process(note: str) -> None:
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"]) as process:
        _started.append(process)
        Path(note).write_text(str(process.pid))
        process.wait()


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_work_is_done_in_other_processes(method: str) -> None:
    with worker_pool(2, method=method) as pool:
        assert list(pool.map(square, range(4))) == [0, 1, 4, 9]
        assert pool.submit(os.getpid).result() != os.getpid()


def test_an_error_ends_the_workers_and_what_they_have_started(tmp_path: Path) -> None:
    note = tmp_path / "pid"
    with (
        pytest.raises(ValueError, match="given up"),
        worker_pool(1, kill_what_was_started) as pool,
    ):
        pool.submit(wait_for_a_process, str(note))
        assert comes_true(lambda: note.exists() and note.read_text())
        raise ValueError("given up")
    assert comes_true(lambda: has_ended(int(note.read_text())))
