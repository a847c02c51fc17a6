# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The table of nodes: their parameters, arguments and processes."""

from __future__ import annotations

import argparse
import os
import runpy
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import ament_index_python.packages
import pytest
import yaml

from fish_bringup import node_table, processes
from fish_bringup.node_table import CONTROL, FAKE, RECORDER, ROBOTS, SIMULATED, NodeSpec, middleware
from fish_bringup.run_page import latency_table
from fish_bringup.run_watch import SwimEnd
from fish_bringup.verbs import arm, demo
from fish_control.nodes.pilot import split_arguments
from fish_report.errors import UserError
from fish_report.robofish import run_verb

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"


SOURCE = Path(__file__).parents[2]
EVERY_NODE = sorted(
    {
        *node_table.ROBOTS["sim"],
        *node_table.ROBOTS["real"],
        *node_table.FAKE,
        node_table.REPLAYER,
        node_table.EXCITER,
        node_table.VIEW,
    },
    key=lambda spec: spec.name,
)


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A stand-in for the install space with one executable."""
    node = tmp_path / "lib" / "fish_sim" / "camera"
    node.parent.mkdir(parents=True)
    node.touch()
    monkeypatch.setattr(node_table, "get_package_prefix", lambda _: str(tmp_path))
    for module in (node_table, ament_index_python.packages):
        monkeypatch.setattr(
            module, "get_package_share_directory", lambda package: f"{tmp_path}/share/{package}"
        )
    return tmp_path


@pytest.mark.parametrize("spec", EVERY_NODE, ids=lambda spec: spec.name)
def test_every_node_has_an_entry_point_and_a_parameter_file(spec):
    assert (
        f'"{spec.executable} = {spec.package}.' in (SOURCE / spec.package / "setup.py").read_text()
    )
    parameters = yaml.safe_load(
        (SOURCE / spec.package / "config" / spec.parameter_file).read_text()
    )
    for settings in parameters.values():
        assert isinstance(settings["ros__parameters"], dict)


def test_a_fake_robot_leaves_the_robots_topics_to_the_drivers(installed):
    """The simulator behind the devices must not publish beside the real drivers, nor hear the robot's commands."""
    behind = {spec.executable: spec for spec in node_table.robot_of("fake") if spec.remaps}
    moved = {rule.partition(":=")[0] for spec in behind.values() for rule in spec.remaps}
    assert {"joint_command", "joint_states", "imu/data", "camera/image_raw/compressed"} <= moved
    assert {"arm", "arming/state", "arming/disarm", "arming/pause", "battery_state"} <= moved
    line = node_table.command(
        NodeSpec("fish_sim", "camera", "camera.yaml", remaps=("a:=b", "c:=d"))
    )
    assert [line[k + 1] for k, word in enumerate(line) if word == "-r"][1:] == ["a:=b", "c:=d"]


def test_unknown_hardware_is_refused():
    with pytest.raises(UserError, match="hardware is 'real', expected one of sim, fake"):
        node_table.robot_of("real")


def test_command_line_keeps_types_of_parameters(installed):
    spec = NodeSpec("fish_sim", "camera", "camera.yaml")
    line = node_table.command(spec, {"path": "N", "speed": 1.0, "loop": True})
    given = [line[k + 1] for k, word in enumerate(line) if word == "-p"]
    values = {
        name: yaml.safe_load(value) for name, value in (item.split(":=", 1) for item in given)
    }
    assert values == {"path": "N", "speed": 1.0, "loop": True}
    assert all(
        type(values[name]) is kind
        for name, kind in (("path", str), ("speed", float), ("loop", bool))
    )
    assert line[0] == str(installed / "lib/fish_sim/camera")


def test_an_executable_that_is_not_built_is_named(installed):
    with pytest.raises(UserError, match="lib/fish_sim/absent does not exist; build"):
        node_table.command(NodeSpec("fish_sim", "absent", "camera.yaml"))


def test_a_workspace_that_is_not_sourced_is_said(monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", "")
    with pytest.raises(UserError, match=r"source install/setup.bash"):
        node_table.command(NodeSpec("fish_sim", "camera", "camera.yaml"))


def test_children_inherit_the_wheels_guard_only_with_the_library_path(monkeypatch):
    monkeypatch.setenv("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "1")
    monkeypatch.delenv("LD_LIBRARY_PATH", raising=False)
    assert "_ROS_WHEELS_BOOTSTRAP_COMPLETE" not in node_table.environment(7)
    monkeypatch.setenv("LD_LIBRARY_PATH", "somewhere")
    child = node_table.environment(7)
    assert child["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] == "1"
    assert child["ROS_DOMAIN_ID"] == "7"


def test_messages_stay_on_this_computer_with_any_middleware(monkeypatch):
    for variable in ("RMW_IMPLEMENTATION", node_table.PROFILE):
        monkeypatch.delenv(variable, raising=False)
    ours = node_table.middleware()
    assert "type>UDPv4" in Path(ours[node_table.PROFILE]).read_text()
    assert ours["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"
    # as a process sees it that runs in this environment
    monkeypatch.setenv(node_table.PROFILE, ours[node_table.PROFILE])
    assert node_table.middleware() == ours
    monkeypatch.setenv(node_table.PROFILE, "their.xml")
    assert node_table.middleware() == {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    monkeypatch.delenv(node_table.PROFILE)
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp")
    assert node_table.middleware() == {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


LAUNCH_ACTIONS = (
    "DeclareLaunchArgument",
    "OpaqueFunction",
    "SetEnvironmentVariable",
    "Shutdown",
)


class Recorded(types.SimpleNamespace):
    """Stands for a class of launch: keeps what it was made with."""

    def __init__(self, *args, **kwargs):
        super().__init__(args=args, **kwargs)


class Configuration(Recorded):
    """Stands for LaunchConfiguration; the context is a dict of arguments."""

    def perform(self, context):
        return context[self.args[0]]


@pytest.fixture
def launch_names(installed, monkeypatch):
    """The names of a package's launch file, with stand-ins for launch and launch_ros, which have no wheels."""
    stand_ins = {
        "launch": {"LaunchContext": dict, "LaunchDescription": Recorded},
        "launch.actions": dict.fromkeys(LAUNCH_ACTIONS, Recorded),
        "launch.conditions": {"IfCondition": Recorded},
        "launch.substitutions": {"LaunchConfiguration": Configuration},
        "launch_ros": {},
        "launch_ros.actions": {"Node": Recorded},
        "launch_ros.parameter_descriptions": {"ParameterValue": Recorded},
    }
    for name, members in stand_ins.items():
        module = types.ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, LOGIC, raising=False)
    return lambda package, file: runpy.run_path(str(SOURCE / package / "launch" / file))


LOGIC = "fish_bringup.nodes.launch_robot"


@pytest.fixture
def launch_file(launch_names):
    """The whole robot's."""
    return launch_names("fish_bringup", "fish.launch.py")


@pytest.fixture
def launched(launch_file):
    """launched(path="S", ...): the nodes that the launch file starts with these arguments, by executable, in order."""
    [*arguments, opaque] = launch_file["generate_launch_description"]().args[0]
    defaults = {argument.args[0]: argument.default_value for argument in arguments}

    def nodes(**given):
        assert given.keys() <= defaults.keys()
        started = opaque.function({**defaults, **given})
        made = [node for node in started if hasattr(node, "executable")]
        if given.get("robot") == "fake":  # the simulator's camera and the driver's have one name
            return {f"{node.package}/{node.executable}": node for node in made}
        return {node.executable: node for node in made}

    return nodes


def parameters(node):
    """Files and, for each parameter in a dict, the argument that it is taken from and its type."""
    return [
        given
        if isinstance(given, str)
        else {name: (value.args[0].args[0], value.value_type) for name, value in given.items()}
        for given in node.parameters
    ]


@pytest.mark.parametrize("robot", ["sim", "real"])
def test_the_launch_file_starts_the_table(launch_file, launched, robot):
    started = [(n.package, n.executable, parameters(n)) for n in launched(robot=robot).values()]
    assert started == [
        (s.package, s.executable, [str(node_table.parameter_path(s))])
        for s in node_table.ROBOTS[robot]
    ]
    [*arguments, _] = launch_file["generate_launch_description"]().args[0]
    assert {argument.args[0] for argument in arguments} >= {
        "robot",
        "path",
        "speed",
        "use_sim_time",
    }


@pytest.mark.parametrize("robot", ["sim", "real"])
def test_with_a_program_the_exciter_takes_the_place_of_planner_and_controller(launched, robot):
    nodes = launched(robot=robot, program="diagnosis.json", begin="2.5", end="34")
    assert list(nodes) == [
        *(
            s.executable
            for s in node_table.ROBOTS[robot]
            if s.executable not in ("planner", "controller")
        ),
        "exciter",
    ]
    given = {"program_file": ("program", str), "begin": ("begin", float), "end": ("end", float)}
    assert parameters(nodes["exciter"]) == [
        str(node_table.parameter_path(node_table.EXCITER)),
        given,
    ]


def test_a_fake_robot_is_launched_with_the_drivers_on_its_devices(launched, tmp_path):
    for file in ("rotor.yaml", "camera.yaml"):  # of a real robot
        (tmp_path / file).touch()
    nodes = launched(robot="fake", config=str(tmp_path))
    assert list(nodes) == [spec.name for spec in node_table.ROBOTS["fake"]]
    folder = next(one for one in nodes["fish_hw/fake_robot"].parameters if isinstance(one, dict))
    devices = Path(folder["folder"])
    assert devices.name == "fish_devices"
    expected = node_table.fake_parameters(devices)
    for spec in node_table.ROBOTS["fake"]:
        if spec in expected:
            assert nodes[spec.name].parameters[-1] == expected[spec]
    assert nodes["fish_sim/camera"].parameters == [
        str(node_table.parameter_path(node_table.FAKE[2]))
    ]
    moved = nodes["fish_sim/camera"].remappings
    assert ("__node", "fake_camera") in moved
    assert ("camera/image_raw/compressed", "fake/image/compressed") in moved
    with pytest.raises(RuntimeError, match="part:=fish of robot:=fake is unknown"):
        launched(robot="fake", part="fish")


def test_the_launch_file_hands_the_planner_its_path_and_arguments_as_text(launched):
    """Else launch would read {radius: 0.6} as a dict, and N as false."""
    planner = launched(path="circle", path_args="{radius: 0.6}", speed="0.1")["planner"]
    given = {"path": ("path", str), "path_args": ("path_args", str), "speed": ("speed", float)}
    assert parameters(planner) == [str(node_table.parameter_path(node_table.CONTROL[2])), given]


@pytest.mark.parametrize(
    ("robot", "simulator"), [("sim", "simulator"), ("fake", "fish_sim/simulator")]
)
def test_on_a_slow_clock_every_node_follows_the_simulator(launched, robot, simulator):
    nodes = launched(robot=robot, real_time_factor="0.2")
    assert all({"use_sim_time": True} in node.parameters for node in nodes.values())
    slowed = [node for node in nodes.values() if "real_time_factor" in node.parameters[-1]]
    assert slowed == [nodes[simulator]]
    assert (node_table.LAGS in nodes[simulator].parameters) == (robot == "fake")
    assert not any({"use_sim_time": True} in node.parameters for node in launched().values())


def test_parts_of_the_robot_are_launched_alone(launched):
    drivers = ["rotor", "rudder", "imu", "camera"]
    assert list(launched(robot="real", part="drivers")) == drivers
    assert list(launched(robot="real", part="fish")) == drivers[:3]
    at_the_pool = ["camera", "tracker", "fusion", "planner", "controller"]
    assert list(launched(robot="real", part="shore", record="false")) == at_the_pool
    assert list(launched(view="true"))[-1] == "live_view"
    with pytest.raises(RuntimeError, match="part:=fish of robot:=sim is unknown"):
        launched(part="fish")
    with pytest.raises(RuntimeError, match="got 'yes', expected true or false"):
        launched(record="yes")


@pytest.mark.parametrize("respawn", ["true", "false"])
def test_a_node_that_ends_is_started_again_or_ends_the_launch(launched, respawn):
    nodes = launched(respawn=respawn, view="true")
    for name, node in nodes.items():
        assert node.respawn == (respawn == "true")
        ends_all = respawn == "false" and name not in ("recorder", "live_view")
        assert (node.on_exit is not None) == ends_all
    if respawn == "false":
        assert nodes["planner"].on_exit.reason == "fish_control/planner ended"


def test_composed_nodes_have_the_parameters_that_they_have_alone(launched, tmp_path):
    """In the installed file of each, in the robot's own, and in the arguments; the namespace, which launch adds, is for all."""
    (tmp_path / "fusion.yaml").touch()
    given = {"path": "N", "speed": "0.1", "use_sim_time": "true", "config": str(tmp_path)}
    alone, together = launched(**given), launched(compose="true", **given)
    names = {"fusion", "planner", "controller"}
    assert set(alone) - set(together) == names
    pilot = together["pilot"]
    assert pilot.on_exit.reason == "fish_control/pilot ended"
    common, own = split_arguments([*pilot.arguments, "--ros-args", "-r", "__ns:=/fish"])
    assert common == ["--ros-args", "-r", "__ns:=/fish"]
    for name in names:
        files = [own[name][k + 1] for k, word in enumerate(own[name]) if word == "--params-file"]
        assert files == [file for file in alone[name].parameters if isinstance(file, str)]
    assert own["planner"][-5::2] == ["use_sim_time:=true", 'path:="N"', "speed:=0.1"]
    assert "pilot" not in launched(compose="true", robot="real", part="fish")
    assert "pilot" not in launched(compose="true", program="diagnosis.json")


def test_a_process_of_several_nodes_hands_each_its_own(installed):
    (installed / "lib" / "fish_control").mkdir()
    (installed / "lib" / "fish_control" / "pilot").touch()
    planner = node_table.CONTROL[2]
    line = node_table.command(node_table.PILOT, {planner: {"path": "N"}}, "/fish_2")
    common, own = split_arguments(line[1:])
    assert common == ["--ros-args", "-r", "__ns:=/fish_2", "-r", "/clock:=/fish_2/clock"]
    assert own["planner"][-2:] == ["-p", 'path:="N"']
    assert 'frame_prefix:="fish_2/"' in own["fusion"]
    assert not any("path:=" in word for word in own["fusion"] + own["controller"])


def test_a_second_fish_has_a_clock_and_frames_of_its_own(launched):
    usual = launched()
    assert {node.namespace for node in usual.values()} == {"fish"}
    assert all(not node.remappings for node in usual.values())
    second = launched(namespace="fish_2")
    assert all(node.remappings == [("/clock", "clock")] for node in second.values())
    assert {"frame_prefix": "fish_2/"} in second["fusion"].parameters
    assert not any("frame_prefix" in given for given in second["controller"].parameters)


@pytest.mark.parametrize(
    ("file", "nodes"),
    [
        ("simulation", {"simulator", "planner", "recorder"}),
        ("robot", {"rotor", "planner", "recorder"}),
        ("in_the_fish", {"rotor", "rudder", "imu"}),
        ("at_the_pool", {"camera", "planner", "recorder"}),
    ],
)
def test_each_launch_file_fixes_its_choice(launch_names, file, nodes):
    description = launch_names("fish_bringup", f"{file}.launch.py")["generate_launch_description"]
    [*arguments, opaque] = description().args[0]
    given = {argument.args[0]: argument.default_value for argument in arguments}
    assert all(argument.description for argument in arguments)
    assert not {"robot", "part"} & set(given)
    started = {made.executable for made in opaque.function(given)}
    assert nodes <= started
    assert len(nodes & {"rotor", "simulator"}) == len(started & {"rotor", "simulator"})


def test_messages_stay_on_this_computer_if_the_launch_says_so(launch_file):
    [*arguments, opaque] = launch_file["generate_launch_description"]().args[0]
    given = {argument.args[0]: argument.default_value for argument in arguments}
    variables = [m.args for m in opaque.function({**given, "local": "true"}) if m.args]
    assert variables == list(node_table.middleware().items())


def test_the_launch_file_refuses_an_unknown_robot(launched):
    with pytest.raises(RuntimeError, match="known: sim, fake, real"):
        launched(robot="whale")


def test_the_launch_file_refuses_another_time_for_a_real_robot(launched):
    with pytest.raises(RuntimeError, match="real_time_factor:=2 is for robot:=sim and robot:=fake"):
        launched(robot="real", real_time_factor="2")
    with pytest.raises(RuntimeError, match="use_sim_time:=true is for robot:=sim and robot:=fake"):
        launched(robot="real", use_sim_time="true")


@pytest.mark.parametrize(
    ("given", "overridden"),
    [
        ({}, {}),
        ({"path": "S"}, {"path": ("path", str)}),
        (
            {"speed": "0.1", "use_sim_time": "true"},
            {"use_sim_time": ("use_sim_time", bool), "speed": ("speed", float)},
        ),
    ],
)
def test_only_arguments_that_are_given_override_a_robots_own_values(
    launched, tmp_path, given, overridden
):
    """The arguments' defaults had overridden the robot's own planner.yaml."""
    own = [tmp_path / "planner.yaml", tmp_path / "fusion.yaml"]
    for file in own:
        file.touch()
    nodes = launched(robot="real", part="shore", config=str(tmp_path), **given)
    installed = [
        str(node_table.parameter_path(spec))
        for spec in (node_table.CONTROL[2], node_table.CONTROL[1])
    ]
    last = [overridden] if overridden else []
    assert parameters(nodes["planner"]) == [installed[0], str(own[0]), *last]
    everybody = (
        [{"use_sim_time": overridden["use_sim_time"]}] if "use_sim_time" in overridden else []
    )
    assert parameters(nodes["fusion"]) == [installed[1], str(own[1]), *everybody]


def test_a_robots_own_values_override_the_installed_ones(launched, tmp_path):
    context = {"robot": "real", "config": str(tmp_path)}
    with pytest.raises(
        RuntimeError, match=r"holds none of .*; expected some of rotor.yaml, rudder.yaml"
    ):
        launched(**context)
    (tmp_path / "tracker.yaml").touch()
    files = {name: parameters(node) for name, node in launched(**context).items()}
    assert files["tracker"][1:] == [str(tmp_path / "tracker.yaml")]
    assert all(len(given) == 1 for name, given in files.items() if name != "tracker")


def test_the_drivers_alone_take_a_robots_own_values_in_the_same_way(launch_names, tmp_path):
    [*arguments, opaque] = launch_names("fish_hw", "drivers.launch.py")[
        "generate_launch_description"
    ]().args[0]
    with pytest.raises(
        RuntimeError, match=r"holds none of .*; expected some of rotor.yaml, rudder.yaml"
    ):
        opaque.function({"config": str(tmp_path)})
    (tmp_path / "rotor.yaml").touch()
    drivers = [spec for spec in node_table.ROBOTS["real"] if spec.package == "fish_hw"]
    installed = {spec.executable: [str(node_table.parameter_path(spec))] for spec in drivers}
    for config, own in (("", []), (str(tmp_path), [str(tmp_path / "rotor.yaml")])):
        nodes = opaque.function({"config": config})
        files = {node.executable: node.parameters for node in nodes}
        assert [node.on_exit.reason for node in nodes] == [f"{name} ended" for name in files]
        assert files == {**installed, "rotor": installed["rotor"] + own}
    assert {argument.args[0] for argument in arguments} == {"config", "namespace", *installed}


VERBS = ("arm", "disarm", "drive", "view")
WRONG = ("bad name!", "", "/fish//two", "/2fish", "/", "/fish__2")


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("namespace", WRONG)
def test_a_namespace_that_ros_does_not_know_is_refused(verb: str, namespace: str, capsys) -> None:
    assert run_verb(verb, ["--namespace", namespace]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"robofish {verb}: namespace is {namespace!r}, expected")
    assert said.count("\n") == 1


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("domain", ["-1", "233"])
def test_a_domain_out_of_range_is_refused(verb: str, domain: str, capsys) -> None:
    assert run_verb(verb, ["--domain", domain]) == 1
    assert capsys.readouterr().err == f"robofish {verb}: domain is {domain}, expected 0 to 232\n"


@pytest.mark.parametrize(
    ("words", "said"),
    [(["arm"], "not armed"), (["arm", "--off"], "not disarmed"), (["disarm"], "not disarmed")],
)
def test_a_refusal_says_what_was_not_done(monkeypatch, capsys, words, said) -> None:
    monkeypatch.setattr(arm, "set_armed", lambda *_: (False, "the node ends"))
    assert run_verb(words[0], words[1:]) == 1
    assert capsys.readouterr().err == f"robofish {words[0]}: {said}: the node ends\n"


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


def test_a_shell_takes_the_lines_over(capsys):
    assert run_verb("loopback", []) == 0
    lines = capsys.readouterr().out
    wanted = middleware()
    shown = subprocess.run(
        ["bash", "-c", lines + "".join(f'echo "${name}"\n' for name in wanted)],
        capture_output=True,
        text=True,
        check=True,
        env={"PATH": "/usr/bin:/bin"},
    )
    assert shown.stdout.splitlines() == list(wanted.values())


POLITE = """
import time
try: print('ready', flush=True); time.sleep(60)
except KeyboardInterrupt: print('bye')
"""
DEAF = """
import signal, time
for number in (signal.SIGINT, signal.SIGTERM): signal.signal(number, signal.SIG_IGN)
print('ready', flush=True); time.sleep(60)
"""
BUSY = "print('ready', flush=True)\nwhile True: sum(range(1000))"
BROKEN = "import sys; print('no such weights', file=sys.stderr); sys.exit(3)"
PROGRAMS = {"polite": POLITE, "deaf": DEAF, "busy": BUSY, "broken": BROKEN}


@pytest.fixture
def nodes(tmp_path, monkeypatch):
    """A set of processes that run PROGRAMS by executable name."""
    monkeypatch.setattr(
        processes, "command", lambda spec, *_: [sys.executable, "-c", PROGRAMS[spec.executable]]
    )
    monkeypatch.setattr(
        processes, "GRACE", ((signal.SIGINT, 3.0), (signal.SIGTERM, 0.2), (signal.SIGKILL, 3.0))
    )
    with processes.NodeProcesses(0, tmp_path / "logs") as nodes:
        yield nodes


def start(nodes, executable):
    process = nodes.start(NodeSpec("test", executable, "none.yaml"))
    deadline = time.monotonic() + 10.0
    while "ready" not in process.log.read_text() and process.status is None:
        assert time.monotonic() < deadline, "the program did not start"
        time.sleep(0.01)
    return process


def test_sigint_ends_a_polite_process_with_0(nodes):
    process = start(nodes, "polite")
    assert nodes.stop() == {process.spec: 0}
    assert process.last_words() == "bye"


def test_a_deaf_process_is_killed_in_the_end(nodes, monkeypatch):
    monkeypatch.setattr(
        processes, "GRACE", ((signal.SIGINT, 0.2), (signal.SIGTERM, 0.2), (signal.SIGKILL, 3.0))
    )
    process = start(nodes, "deaf")
    assert nodes.stop() == {process.spec: -signal.SIGKILL}


def test_a_process_that_fails_is_found_with_its_last_words(nodes):
    process = start(nodes, "broken")
    assert process.wait(5.0) == 3
    assert [(ended.spec.executable, ended.last_words()) for ended in nodes.ended()] == [
        ("broken", "no such weights")
    ]


def test_a_process_can_be_started_again_after_kill(nodes):
    first = start(nodes, "polite")
    first.signal(signal.SIGKILL)
    assert first.wait(5.0) == -signal.SIGKILL
    second = nodes.start(first.spec)
    assert second.pid != first.pid
    assert nodes.ended() == []


def test_cpu_time_is_that_of_the_process(nodes):
    busy, idle = start(nodes, "busy"), start(nodes, "polite")
    began, before = time.monotonic(), busy.cpu_time()
    while (used := busy.cpu_time() - before) < 0.1:  # it may share its core
        assert time.monotonic() - began < 60.0, f"{used} s"
        time.sleep(0.05)
    assert used <= time.monotonic() - began + 0.02
    assert idle.cpu_time() < 2.0


def test_nothing_survives_the_starter(tmp_path):
    """kill -9 of the starter ends the node: the kernel sends it SIGTERM."""
    starter = f"""
import sys, time
from pathlib import Path
from fish_bringup import processes
from fish_bringup.node_table import NodeSpec
processes.command = lambda spec, *_: [sys.executable, "-c", {POLITE!r}]
nodes = processes.NodeProcesses(0, Path({str(tmp_path)!r}))
print(nodes.start(NodeSpec("test", "polite", "none.yaml")).pid, flush=True)
time.sleep(60)
"""
    with subprocess.Popen(
        [sys.executable, "-c", starter], stdout=subprocess.PIPE, text=True
    ) as parent:
        child = int(parent.stdout.readline())
        parent.kill()
        parent.wait()
    deadline = time.monotonic() + 10.0
    while _alive(child):
        assert time.monotonic() < deadline, "the node outlived its starter"
        time.sleep(0.02)


def _alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] != "Z"  # a zombie waits for init only
    except FileNotFoundError:
        return False
