# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the demo's options change in the nodes' parameters."""

import argparse
from pathlib import Path

from fish_bringup.node_table import CONTROL, FAKE, RECORDER, ROBOTS, SIMULATED
from fish_bringup.run_tables import latency_table
from fish_bringup.run_watch import SwimEnd
from fish_bringup.verbs import demo


def changed(*words: str) -> dict:
    parser = argparse.ArgumentParser()
    demo.add_arguments(parser)
    args = parser.parse_args(["--real-time-factor", "1", *words])
    return demo.node_parameters(args, {"start_x": 0.0}, Path("folder"), Path("devices"))


def follow_clock(given: dict, robot: tuple) -> bool:
    """All but the simulator, which says the time, and the recorder, whose time is the wall clock's."""
    without = {spec.executable for spec in robot if "use_sim_time" not in given.get(spec, {})}
    return without == {"simulator", "recorder"}


def test_in_lockstep_the_simulator_waits_and_every_node_follows_its_clock(tmp_path) -> None:
    weights = tmp_path / "gains.safetensors"
    given = changed("--lockstep", "--weights", str(weights))
    assert given[SIMULATED[0]]["lockstep"] == demo.LOCKSTEP
    assert follow_clock(given, ROBOTS["sim"])
    assert given[CONTROL[3]]["weights_file"] == str(weights)
    assert given[RECORDER]["name"] == "recording"


def test_simulated_time_waits_for_nodes_that_lag_by_more_than_an_image() -> None:
    given = changed()
    assert given[SIMULATED[0]]["lockstep"] > 0.0
    assert 0.0 < given[SIMULATED[0]]["lockstep_slack"] < 0.05
    assert follow_clock(given, ROBOTS["sim"])


def test_simulated_time_waits_for_the_tracker_too() -> None:
    """With room for the camera's delay and one lost picture, and less than what fusion takes for a step of a clock."""
    for words in ((), ("--lockstep",)):
        assert 0.12 < changed(*words)[SIMULATED[0]]["lockstep_camera"] < 0.17
    assert "lockstep_camera" not in changed("--hardware", "fake")[FAKE[1]]  # which says it itself


def test_in_real_time_nodes_follow_their_own_clocks() -> None:
    given = changed("--real-time")
    assert not {"lockstep", "lockstep_camera"} & given[SIMULATED[0]].keys()
    assert not any("use_sim_time" in values for values in given.values())


def test_a_run_that_waited_says_how_long() -> None:
    end = SwimEnd("at the end of the path", seconds=48.0, robot_s=30.0, cpu={})
    assert "30 s of swimming took 48 s" in demo.waited(end, 1.0)
    assert demo.waited(end, 0.62) == ""


def test_a_computer_that_the_nodes_fill_is_named_with_what_to_do() -> None:
    shares = [0.3] * 6  # of a core
    assert "--real-time" in demo.too_slow(shares, cores=2)
    assert demo.too_slow(shares, cores=4) == ""


def test_on_a_slow_clock_every_node_of_a_fake_robot_follows_the_simulator() -> None:
    given = changed("--hardware", "fake", "--real-time-factor", "0.2")
    assert given[FAKE[1]]["real_time_factor"] == 0.2
    assert given[FAKE[1]]["lockstep"] > 0.0
    assert follow_clock(given, ROBOTS["fake"])


def test_a_computer_with_few_cores_gets_a_slower_fake_robot_and_no_slower_simulation() -> None:
    paces = [demo.pace("fake", cores) for cores in (1, 2, 4, 8, 64)]
    assert paces == sorted(paces)
    assert 0.0 < paces[0] < 0.3
    assert paces[-1] == 1.0
    assert demo.pace("sim", 1) == 1.0


def test_the_latency_is_the_robot_s_own_and_its_texts_can_do_no_harm():
    said = {"latency [/x]\x1b[31m": "m" * 5000, "commands": "7"}
    table = latency_table({"evil/controller": {"latency": "1"}, "fish/controller": said})
    ((key, value),) = table.rows
    assert key == "latency [/x]\\x1b[31m"
    assert len(value) < 500
