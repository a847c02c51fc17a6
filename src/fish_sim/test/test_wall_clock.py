# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The simulator node beside a wall clock that is set, and after it was held up; the test calls its callbacks itself."""

import pytest
import rclpy

from fish_sim.nodes import simulator

pytestmark = pytest.mark.ros
DOMAIN = 144


@pytest.fixture
def simulated():
    """simulated(parameter=value, ...): a simulator node."""
    nodes = []

    def make(**parameters):
        given = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        rclpy.init(args=["--ros-args", *given], domain_id=DOMAIN)
        nodes.append(simulator.SimulatorNode())
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()
    if rclpy.ok():
        rclpy.shutdown()  # unlike try_shutdown it takes the signal handlers away


class Clocks:
    """Stands for the module time, with a wall clock that can be set."""

    def __init__(self):
        self.steady, self.wall = 50.0, 1.7e9

    def monotonic(self):
        return self.steady

    def time_ns(self):
        return round(self.wall * 1e9)

    def run(self, node, seconds):
        """Tick for a while; returns how much the last stamp is behind the wall clock [s]."""
        for _ in range(round(100 * seconds)):
            self.steady, self.wall = self.steady + 0.01, self.wall + 0.01
            node._tick()
        return (
            self.wall
            - node._stamp(node._simulation.time).sec
            - 1e-9 * node._stamp(node._simulation.time).nanosec
        )


@pytest.mark.parametrize("step", [3600.0, 0.5, -0.5, -3600.0])
def test_the_simulator_follows_a_wall_clock_that_is_set(simulated, monkeypatch, capfd, step):
    clocks = Clocks()
    monkeypatch.setattr(simulator, "time", clocks)
    node = simulated()
    assert abs(clocks.run(node, 1.0)) < 0.02
    assert node._simulation.time == pytest.approx(1.0, abs=0.02)
    clocks.wall += step
    assert abs(clocks.run(node, 1.0)) < 0.03
    assert node._simulation.time == pytest.approx(2.0, abs=0.05)
    assert node._pacer.lost == 0.0
    assert capfd.readouterr().err.count("the wall clock was set") == 1


@pytest.mark.parametrize(
    ("parameters", "step"),
    [({}, 0.1), ({"use_sim_time": "true"}, 60.0), ({"real_time_factor": 2.0}, 60.0)],
)
def test_the_simulators_time_stays_even_where_the_wall_clock_hardly_moved_or_is_not_followed(
    simulated, monkeypatch, parameters, step
):
    clocks = Clocks()
    monkeypatch.setattr(simulator, "time", clocks)
    node = simulated(**parameters)
    before = clocks.run(node, 0.5)
    clocks.wall += step
    assert clocks.run(node, 0.01) == pytest.approx(before + step, abs=0.05)


def test_a_simulator_that_was_held_up_counts_what_it_lost_and_is_not_called_set(
    simulated, monkeypatch, capfd
):
    clocks = Clocks()
    monkeypatch.setattr(simulator, "time", clocks)
    node = simulated()
    clocks.run(node, 0.5)
    clocks.steady, clocks.wall = clocks.steady + 3.0, clocks.wall + 3.0
    assert abs(clocks.run(node, 0.5)) < 0.03
    assert node._pacer.lost == pytest.approx(3.0, abs=0.02)
    clocks.steady, clocks.wall = clocks.steady + 0.15, clocks.wall + 0.15  # is caught up with
    assert abs(clocks.run(node, 0.1)) < 0.03
    assert node._pacer.lost == pytest.approx(3.0, abs=0.02)
    assert "the wall clock was set" not in capfd.readouterr().err
