# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command line: every verb loads, mistakes are one line."""

import os
import subprocess
import sys
from argparse import ArgumentParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fish_bag import sample_recordings as samples
from fish_control.excitation import LAST_ROW
from fish_report import robofish as command
from fish_report.robofish import BROUGHT_BY
from fish_sim.robot import Robot


@pytest.mark.parametrize("verb", BROUGHT_BY)
def test_every_verb_is_a_module_with_help(verb):
    module = command.installed_verbs()[verb].load()
    parser = ArgumentParser()
    module.add_arguments(parser)
    assert module.__doc__
    assert callable(module.run)
    assert callable(getattr(command, verb))  # the entry point of its own executable


def test_help_is_fast_because_no_verb_is_loaded():
    code = (
        "import sys; from fish_report.robofish import main; main(['--help']); print(*sys.modules)"
    )
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    *table, modules = out.splitlines()
    assert all(any(line.split()[:1] == [verb] for line in table) for verb in BROUGHT_BY)
    assert not {"numpy", "rosbags", "torch", "rclpy"} & set(modules.split())


def test_names_and_terminals_that_are_not_utf_8(tmp_path):
    """A file from another computer, and a pipe that takes ASCII only."""
    path = samples.robot_recording(tmp_path / "swim\udcff", duration=0.3)
    code = "import sys; from fish_report.robofish import main; sys.exit(main(sys.argv[1:]))"
    page = tmp_path / "page.html"
    ended = subprocess.run(
        [sys.executable, "-c", code, "inspect", path, "--html", page],
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        capture_output=True,
    )
    assert ended.returncode == 0, ended.stderr
    assert b"/fish/imu/data" in ended.stdout
    assert r"swim\udcff" in page.read_text(encoding="utf-8")


def test_unknown_verb(capsys):
    assert command.main(["swim_faster"]) == 2
    assert "unknown verb 'swim_faster'; known: " in capsys.readouterr().err


def test_an_option_is_written_out(capsys):
    """--path is not taken for --path-args."""
    with pytest.raises(SystemExit) as end:
        command.main(["demo", "--path", "R"])
    assert end.value.code == 2
    assert "unrecognized arguments: --path R" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--candidates", "--false-alarms", "--without"])
def test_a_comparison_has_no_choice_of_the_search(option, tmp_path, capsys):
    days = [str(tmp_path), "--baseline", str(tmp_path), "--out", str(tmp_path / "out")]
    assert command.main(["diagnose", *days, option, "0.1"]) == 1
    assert f"{option} goes without --baseline" in capsys.readouterr().err


def test_no_such_entry_point():
    with pytest.raises(AttributeError, match="swim_faster"):
        command.swim_faster  # noqa: B018


def test_a_package_that_is_not_installed_is_one_line():
    """After `make build` alone there is no torch."""
    verb, package = "train", "torch"
    code = f"import sys; sys.modules[{package!r}] = None; from fish_report.robofish import main; sys.exit(main([{verb!r}]))"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    said = f"robofish {verb}: the Python package {package} is not installed; `make setup`, or "
    assert (ended.returncode, ended.stderr.startswith(said), ended.stderr.count("\n")) == (
        1,
        True,
        1,
    )


@pytest.mark.parametrize("verb", ["inspect", "recover"])
def test_bad_path_is_one_line(capsys, verb):
    assert command.main([verb, "/nowhere/at/all"]) == 1
    error = capsys.readouterr().err
    assert error == f"robofish {verb}: /nowhere/at/all: does not exist\n"


def test_recover_prints_what_was_saved_and_lost(tmp_path, capsys):
    path = samples.robot_recording(tmp_path / "a")
    file = path / "a.mcap"
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    assert command.main(["recover", str(path)]) == 0
    out = capsys.readouterr().out
    assert "/fish/imu/data" in out
    assert "lost: a.mcap: " in out
    assert (tmp_path / "a_recovered" / "metadata.yaml").exists()
    assert command.main(["recover", str(path)]) == 1
    assert "never overwritten" in capsys.readouterr().err


def test_recover_of_the_folder_one_is_in_is_made_beside_it(tmp_path, monkeypatch):
    path = samples.robot_recording(tmp_path / "a")
    monkeypatch.chdir(path)
    assert command.main(["recover", "."]) == 0
    assert (tmp_path / "a_recovered" / "metadata.yaml").exists()
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "b").symlink_to(path)
    assert command.main(["recover", str(tmp_path / "linked" / "b")]) == 0
    assert (tmp_path / "linked" / "b_recovered" / "metadata.yaml").exists()


def test_inspect_prints_and_plots(tmp_path, capsys):
    def lost(i, t, m):
        return None if 20 <= i < 120 else (t, m)

    messages = samples.changed(samples.robot_messages(), "/fish/imu/data", lost)
    path = samples.write_mcap(tmp_path / "a", messages)
    page = tmp_path / "out" / "page.html"
    assert command.main(["inspect", str(path), "--html", str(page)]) == 0
    out = capsys.readouterr().out
    assert "/fish/camera/pose" in out
    assert "1 gaps, longest 1.010 s, about 100 messages" in out
    html = page.read_text()
    assert "a: path in the pool" in html
    assert "1 gaps, longest 1.010 s" in html
    assert "<script src=" not in html
    assert "Plotly.newPlot" in html


def test_inspect_of_the_folder_one_is_in_is_called_after_it(tmp_path, monkeypatch):
    (tmp_path / "set").mkdir()
    samples.robot_recording(tmp_path / "set" / "a")
    monkeypatch.chdir(tmp_path / "set")
    assert command.main(["inspect", "."]) == 0
    assert "<h1>Recording set</h1>" in Path("inspect_set.html").read_text()


def test_diagnose_of_the_folder_one_is_in_is_called_after_it(tmp_path, monkeypatch):
    """The diagnosis itself takes a minute, and is not what names the page."""
    titles, robot = [], SimpleNamespace(robot=Robot(), standard_errors={})
    for name, stand_in in {
        "fish_sysid.diagnosis.pipeline.diagnose": lambda *_, **__: SimpleNamespace(
            task=SimpleNamespace(ahead=0.0, acted=set())
        ),
        "fish_sysid.diagnosis.diagnosis_json.answer": lambda _: {},
        "fish_sysid.diagnosis.corrected_model.corrected": lambda _: robot,
        "fish_sysid.reports.verdict_sentence.sentence": lambda _: "nothing",
        "fish_sysid.reports.diagnosis_page.write_diagnosis_page": lambda _, title, *__: (
            titles.append(title)
        ),
    }.items():
        monkeypatch.setattr(name, stand_in)
    (tmp_path / "set").mkdir()
    samples.robot_recording(tmp_path / "set" / "a")
    monkeypatch.chdir(tmp_path / "set")
    for given in (".", "../set", "a/.."):
        assert command.main(["diagnose", given, "--out", str(tmp_path / "out")]) == 0
    assert titles == ["set", "set", "set"]


def test_scores_of_two_recordings_are_pages_of_their_own(tmp_path, monkeypatch):
    (tmp_path / "report.html").write_text("a demo's")
    way = samples.build.path(
        samples.ns(0.0), "pool", samples.pose(np.arange(0.0, 2.0, 0.01))[:, :2]
    )
    swum = samples.changed(
        samples.robot_messages(), "/fish/reference/path", lambda _, arrival, __: (arrival, way)
    )
    for name in ("trial_1", "trial_2"):
        samples.write_mcap(tmp_path / name, swum)
    assert command.main(["score", str(tmp_path / "trial_1")]) == 0
    monkeypatch.chdir(tmp_path / "trial_2")
    assert command.main(["score", "."]) == 0
    for name in ("trial_1", "trial_2"):
        assert f"<h1>Run {name}</h1>" in (tmp_path / f"score_{name}.html").read_text()
    assert (tmp_path / "report.html").read_text() == "a demo's"


def test_excite_says_how_long_the_last_row_lasts(tmp_path, capsys):
    with pytest.raises(SystemExit):
        command.main(["excite", "--help"])
    assert f"the last row lasts {LAST_ROW:g} s" in " ".join(capsys.readouterr().out.split())
    program = tmp_path / "program.yaml"
    program.write_text("- {t: 7, amplitude: 5, frequency: 2, rudder: 0}")
    assert command.main(["excite", str(program), "--begin", "50"]) == 1
    expected = (
        "expected 0 to 12 s: the program lasts 15 s (8 s from its last row on), a swim at least 3 s"
    )
    assert expected in capsys.readouterr().err


def test_inspect_without_page(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert command.main(["inspect", str(samples.robot_recording(tmp_path / "a")), "--no-html"]) == 0
    assert "robot" in capsys.readouterr().out
    assert not list(Path(tmp_path).glob("*.html"))
