# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command robofish: its verbs, tables and workers."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from argparse import ArgumentParser
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fish_bag import read_trial
from fish_bag import sample_recordings as samples
from fish_bag.problem import Problem
from fish_bag.recording_page import (
    clocks_table,
    figures,
    over_time,
    path_figure,
    problems_table,
    timing_figure,
    topics_table,
    trials_table,
)
from fish_bag.trial import DataSet, Odometry, Trial
from fish_bringup.run_page import _lead, _pool, _pool_note, _speed
from fish_bringup.score import score_motion
from fish_control.excitation import LAST_ROW
from fish_control.reference_path import ReferencePath
from fish_report import robofish as command
from fish_report.robofish import BROUGHT_BY
from fish_sim.robot import Robot
from fish_sim.robot_file import save_robot
from fish_sysid.prediction.prediction import ErrorSizes
from fish_sysid.reports.diagnosis_figures import program, water_over_the_pool, when_it_acts
from fish_sysid.reports.identify_tables import bias_table, error_table, parameter_table


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


def test_an_unknown_stage_is_refused_before_anything_is_read(tmp_path, capsys):
    given = ["diagnose", str(tmp_path), "--out", str(tmp_path / "out"), "--without", "magic"]
    assert command.main(given) == 1
    assert "--without: got magic; expected stages of the search: " in capsys.readouterr().err


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


@pytest.mark.parametrize(
    "verb", [["inspect", "--html"], ["predict", "--model", "robot.yaml", "--out"]]
)
def test_a_folder_in_the_place_of_a_file_is_refused_before_the_work(
    verb, tmp_path, monkeypatch, capsys
):
    samples.robot_recording(tmp_path / "swum")
    monkeypatch.chdir(tmp_path)
    save_robot(Robot(), Path("robot.yaml"))
    assert command.main([verb[0], "swum", *verb[1:], "swum"]) == 1
    told = capsys.readouterr()
    assert f"{verb[-1]} swum: is a folder; expected a file, choose another name" in told.err
    assert not told.out


def test_inspect_without_page(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert command.main(["inspect", str(samples.robot_recording(tmp_path / "a")), "--no-html"]) == 0
    assert "robot" in capsys.readouterr().out
    assert not list(Path(tmp_path).glob("*.html"))


COMMAND = Path(__file__).parents[1] / "src" / "fish_report" / "bin" / "robofish"
MAKEFILE = Path(__file__).parents[1] / "Makefile"


def run(prefixes, *arguments):
    environment = {**os.environ, "AMENT_PREFIX_PATH": prefixes}
    return subprocess.run([COMMAND, *arguments], env=environment, capture_output=True, text=True)


@pytest.mark.parametrize("prefixes", ["", "/nowhere:/opt/ros/*"])
def test_without_a_workspace_it_is_one_line(prefixes):
    ended = run(prefixes, "inspect", "x")
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr.startswith("robofish: ")
    assert "source install/setup.bash first" in ended.stderr
    assert ended.stderr.count("\n") == 1


def test_with_one_its_own_executable_gets_every_argument(tmp_path):
    executable = tmp_path / "a b" / "lib" / "fish_report" / "robofish"
    executable.parent.mkdir(parents=True)
    executable.write_text('#!/bin/sh\nprintf "%s|" "$@"\nexit 7\n')
    executable.chmod(0o755)
    ended = run(f"/nowhere:{tmp_path}/a b", "score", "a: b", "*", "")
    assert (ended.returncode, ended.stdout, ended.stderr) == (7, "score|a: b|*||", "")


@pytest.mark.skipif(not MAKEFILE.exists(), reason="not in this project's tree")
def test_it_is_what_make_build_links():
    assert f"../../src/fish_report/bin/{COMMAND.name} $(VENV)/bin/robofish" in MAKEFILE.read_text()


def test_prediction_errors_are_in_millimetres_and_milliradians() -> None:
    rms = np.array([[0.0123, 0.045, 0.0067], [0.2, np.nan, 0.03]])
    sizes = ErrorSizes((1.0, 5.0), rms, np.zeros((2, 2, 3)), np.array([[4, 1], [5, 0]]))
    table = error_table({"identified": sizes, "arx_ahead": sizes})
    assert table.header == [
        "predictor",
        "mm 1 s",
        "mrad 1 s",
        "mm/s 1 s",
        "mm 5 s",
        "mrad 5 s",
        "mm/s 5 s",
        "predictions",
    ]
    assert table.rows[0] == ["physics, identified", "12.3", "45", "6.7", "200", "", "30", "9 / 1"]
    assert table.rows[1][0] == "linear ARX, with 0.5 s of what comes"
    assert " after 1 and 5 s, " in table.note
    assert "which the baselines are usually given" in table.note


def test_the_caption_of_predictions_speaks_of_nothing_that_is_not_there() -> None:
    sizes = ErrorSizes((2.0,), np.ones((1, 3)), np.zeros((2, 1, 3)), np.ones((2, 1)))
    note = error_table({"model": sizes}).note
    assert " after 2 s, " in note
    assert "starts from what was measured before." in note
    assert "below" not in note
    assert "baselines" not in note


def test_parameters_stand_beside_their_errors_their_start_and_whether_they_are_known() -> None:
    values = {"head_drag_surge": 0.3, "current.x": -0.02}
    errors = {"head_drag_surge": 0.006, "current.x": 0.001}
    fit = SimpleNamespace(values=values, standard_errors=errors, robot=Robot())
    start = Robot().with_parameters(head_drag_surge=0.2)
    rows = parameter_table(
        SimpleNamespace(fit=fit, start=start, undetermined=("current.x",), predicted=None)
    ).rows
    assert rows[0] == ["head_drag_surge", "0.3", "0.006", "N s/m", "1.500", "2 %", ""]
    assert rows[1] == ["current.x", "-0.02", "0.001", "", "", "5 %", "not determined by these data"]


def test_biases_stand_with_their_trial() -> None:
    estimates = SimpleNamespace(
        bias=np.array([[0.001, -0.02, 0.03]]), bias_std=np.array([[1e-4, 2e-3, 3e-3]])
    )
    found = SimpleNamespace(training=SimpleNamespace(names=("a",)), estimates=estimates)
    assert bias_table(found).rows == [
        ["a", "+0.0010 ± 0.0001", "-0.0200 ± 0.0020", "+0.0300 ± 0.0030"]
    ]


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    return read_trial(samples.robot_recording(tmp_path_factory.mktemp("reports") / "swum"))


def test_topics_are_told_with_rate_gap_and_latency_in_milliseconds(trial: Trial) -> None:
    rows = {row[0]: row[1:] for row in topics_table(trial).rows}
    assert rows["/fish/imu/data"] == ("sensor_msgs/Imu", "imu", "200", "100", "10", "2/2/2")
    assert rows["/fish/control/gains"][-1] == "no stamps"
    assert list(rows) == sorted(rows)


def test_clocks_and_trials_are_told(trial: Trial) -> None:
    by_clock = {row[0]: row[1:] for row in clocks_table(trial).rows}
    assert by_clock["camera"][0].startswith("0.025000 ± ")
    assert by_clock["camera"][2] == "no"
    data = DataSet("set", Path("set"), (trial,))
    (row,) = trials_table(data).rows
    assert row[:3] == ("swum", f"{trial.duration:.2f}", str(len(samples.robot_messages())))
    assert row[4] == "0 0 0"
    troubled = DataSet(
        "set", Path("set"), (replace(trial, problems=(Problem("warning", "gap", "", ""),) * 2),)
    )
    assert trials_table(troubled).rows[0][4] == "0 2 0"
    found = Problem("info", "gap", "/a", "a pause", t=1.23456)
    assert problems_table("p", (found,)).rows == (("info", "gap", "/a", "a pause", "1.235"),)


def test_figures_of_a_recording_show_what_was_measured(trial: Trial) -> None:
    path = {line.name: line for line in path_figure(trial).data}
    np.testing.assert_allclose(path["camera"].x, samples.pose(trial.camera.t)[:, 0], atol=1e-9)
    np.testing.assert_array_equal(path["reference"].y, [0.0, 0.5, 0.5])
    timing = {line.name: line for line in timing_figure(trial).data}
    np.testing.assert_allclose(timing["camera latency"].y, 25.0, atol=1e-4)  # ms
    np.testing.assert_allclose(timing["imu period"].y, 10.0, atol=1e-4)
    titles = [figure.title for figure in figures(trial)]
    assert titles == [
        f"swum: {what}"
        for what in ("path in the pool", "measurements and commands", "latency and period")
    ]


def test_flagged_samples_are_marked_and_long_lines_thinned() -> None:
    t = 0.001 * np.arange(20000)
    flags = np.zeros(20000, np.uint8)
    flags[[5, 777]] = 4
    long = Odometry(
        topic="/o",
        frame_id="pool",
        t=t,
        t_arrival=t,
        flags=flags,
        **dict.fromkeys("xyuvr", t),
        psi=t,
    )
    line, marks = over_time([("speed", [("u", long, long.u)])]).data
    assert 6000 <= len(line.x) < 12000
    assert line.x[0] == 0.0
    assert marks.x.tolist() == [0.005, 0.777]


@pytest.fixture(scope="module")
def run_and_read():
    """2 m along x at 0.2 m/s, 10 cm beside the path for the first 5 s."""
    path = ReferencePath.from_points([[-1.0, 0.0], [1.0, 0.0]], name="straight")
    t = np.arange(0.0, 9.0, 0.01)
    zero, beside = np.zeros(len(t)), np.where(t < 5.0, 0.1, 0.0)
    truth = Odometry(
        topic="x",
        frame_id="pool",
        t=t,
        t_arrival=t,
        flags=zero.astype(np.uint8),
        x=-1.0 + 0.2 * t,
        y=beside,
        psi=zero,
        u=zero + 0.19,
        v=zero,
        r=zero,
    )
    return score_motion(truth, path, 0.2, 0.0, "truth")


def test_the_page_of_a_run_sets_the_approach_apart(run_and_read) -> None:
    lines = {line.name: line for line in _pool(run_and_read).data}
    assert max(lines["approach"].y) == 0.1
    assert max(np.abs(lines["swum"].y)) == 0.0
    assert lines["approach"].x[-1] == lines["swum"].x[0]  # one line, in two colours
    assert (lines["start"].x[0], lines["start"].y[0]) == (-1.0, 0.1)
    assert _lead(run_and_read) == (
        "9.0 s at 0.20 m/s, 1.80 m of the path; the fish did not end on the path's end. "
        "Scored against the simulator's true pose."
    )
    assert [line.y[100] for line in _speed(run_and_read).data] == pytest.approx([0.19, 0.19, 0.2])
    assert _pool_note(run_and_read) == f"The approach phase took {run_and_read.approach_s:.1f} s."
    assert 4.0 < run_and_read.approach_s < 5.1
    assert "never ended" in _pool_note(SimpleNamespace(approach_s=np.nan))


def test_the_next_experiment_is_drawn_until_its_last_row_is_over() -> None:
    rows = [
        {"t": 0.0, "amplitude": 7.0, "frequency": 2.0, "rudder": 0.5},
        {"t": 20.0, "amplitude": 7.0, "frequency": 2.0, "rudder": -0.5},
    ]
    lines = {line.name: line for line in program({"next_experiment": {"program": rows}}).data}
    assert lines["rudder"].y == (0.5, -0.5, -0.5)
    assert lines["rudder"].line.shape == "hv"
    assert lines["rudder"].x[:2] == (0.0, 20.0)
    assert lines["rudder"].x[2] > 20.0


def test_intervals_are_drawn_on_their_trials() -> None:
    where = {
        "time": [
            {"trial": "b", "from": 1.0, "to": 3.5, "share": 0.7},
            {"trial": "a", "from": 2.0, "to": 3.0, "share": 0.3},
        ],
        "covariates": [{"name": "wall_distance", "range": [0.05, 0.21], "f1": 0.93}],
    }
    figure = when_it_acts({"name": "wall_effect", "where": where})
    (bars,) = figure.figure.data
    assert bars.y == ("a", "b")
    assert bars.base == (2.0, 1.0)
    assert bars.x == (1.0, 2.5)
    assert "wall_distance from 0.05 to 0.21 tells them best (F1 0.93)" in figure.note


def test_the_water_is_drawn_as_it_flows() -> None:
    """The same arrow everywhere for a current, as long as it is fast, along it."""
    effect = {"name": "current", "parameters": {"x": {"value": 0.03}, "y": {"value": -0.04}}}
    seen = SimpleNamespace(
        force=SimpleNamespace(covariates={"x": np.zeros((20, 2)), "y": np.ones((20, 2))})
    )
    drawn = water_over_the_pool(effect, seen)
    assert drawn.note.startswith("longest arrow: 0.05 m/s")
    arrows, fish = drawn.figure.data
    along = np.array([[arrows.x[1] - arrows.x[0], arrows.y[1] - arrows.y[0]]])
    assert along[0] / np.linalg.norm(along) == pytest.approx([0.6, -0.8])
    assert set(fish.y) == {1.0}


LONG = 30.0  # s, of a task that nobody waits for
_queue = None  # of a worker


@pytest.fixture
def workers():
    """Those that are there; none may be left in the end."""
    before = set(multiprocessing.active_children())

    def workers():
        return set(multiprocessing.active_children()) - before

    yield workers
    for worker in workers():
        assert ends(worker.pid), "a worker outlived its pool"


def ends(process: int) -> bool:
    """Wait for its end. The system is asked: `is_alive` errs for a moment where another thread has reaped the process."""
    deadline = time.monotonic() + 10.0
    while alive(process) and time.monotonic() < deadline:
        time.sleep(0.02)
    return not alive(process)


def alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def listen(queue) -> None:
    global _queue
    _queue = queue


def flood(place: Path) -> None:
    """The terminal's Ctrl-C, which reaches the workers too; then more to say than a pipe holds, and work to do."""
    place.touch()
    signal.raise_signal(signal.SIGINT)
    for _ in range(64):
        _queue.put("x" * 4096)
    time.sleep(LONG)


def fail_beside_one_that_talks(place: Path) -> None:
    if place.name == "fails":
        raise ZeroDivisionError(place.name)
    end = time.monotonic() + LONG
    while time.monotonic() < end:
        _queue.put("still training")
        time.sleep(0.01)
    place.touch()


def fail_or_work(place: Path) -> None:
    if place.name == "fails":
        raise ZeroDivisionError(place.name)
    time.sleep(LONG)
    place.touch()


def seeds_of(work, monkeypatch: pytest.MonkeyPatch):
    """The module that runs parallel_runs, with light workers."""
    from fish_train.training import parallel_runs

    monkeypatch.setattr(parallel_runs, "_work", work)
    monkeypatch.setattr(parallel_runs, "_listen", listen)
    monkeypatch.setattr(parallel_runs, "check_job", lambda _: None)
    return parallel_runs


def test_ctrl_c_ends_the_seeds_and_begins_none_that_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers
) -> None:
    def report(_) -> None:
        raise KeyboardInterrupt

    jobs = [tmp_path / str(k) for k in range(4)]
    with pytest.raises(KeyboardInterrupt):
        seeds_of(flood, monkeypatch).run_all(jobs, 2, report)
    for worker in workers():
        assert ends(worker.pid), "a worker outlived its pool"
    assert not any(job.exists() for job in jobs[2:])


def test_the_first_error_ends_the_seeds_however_much_the_others_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers
) -> None:
    jobs = [tmp_path / "talks", tmp_path / "fails"]
    with pytest.raises(ZeroDivisionError, match="fails"):
        seeds_of(fail_beside_one_that_talks, monkeypatch).run_all(jobs, 2, lambda _: None)
    assert not (tmp_path / "talks").exists()


def test_the_first_error_ends_a_study(tmp_path: Path, workers) -> None:
    from fish_train.evaluation.study import _in_processes

    places = [tmp_path / name for name in ("fails", "a", "b", "c")]
    with pytest.raises(ZeroDivisionError, match="fails"):
        _in_processes(fail_or_work, [(place,) for place in places], 2)
    assert list(tmp_path.iterdir()) == []


def test_workers_are_prepared_and_gone_when_the_work_is_done(tmp_path: Path, workers) -> None:
    from fish_report.parallel import worker_pool

    with worker_pool(1, os.chdir, tmp_path) as pool:
        assert pool.submit(os.getcwd).result() == str(tmp_path)


def test_workers_do_not_outlive_a_killed_owner() -> None:
    owner = """
import os, time
from fish_report.parallel import worker_pool
with worker_pool(1) as pool:
    print(pool.submit(os.getpid).result(), flush=True)
    pool.submit(time.sleep, 60).result()
"""
    with subprocess.Popen(
        [sys.executable, "-c", owner], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as parent:
        worker = int(parent.stdout.readline())
        parent.kill()
        parent.wait()
    assert ends(worker)
