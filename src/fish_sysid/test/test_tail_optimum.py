"""A tail of five links has optima so close together that a fit ends beside the best: reheated it comes there."""

import numpy as np

from fish_sim.robot import Robot
from fish_sysid.dataset.synthetic import program, record
from fish_sysid.diagnosis.model_order import with_links
from fish_sysid.diagnosis.refit import reheat
from fish_sysid.estimation.ekf_types import Noise
from fish_sysid.estimation.map_fit import evaluate
from fish_sysid.estimation.noise_estimation import settle
from fish_sysid.estimation.parametrization import Coordinates, nominal_hypothesis
from fish_sysid.estimation.sensor_noise import usual_noise

# the other way from where a fit of such a fish had ended (logarithms)
BESIDE = {
    "head_added_mass_surge": 0.093,
    "head_added_mass_sway": 0.021,
    "head_inertia": 0.018,
    "link_inertia_factor": 0.034,
    "fin_added_mass_sway": 0.085,
    "fin_inertia_factor": 0.197,
    "tail_stiffness": 0.016,
    "rotor_inertia": 0.013,
    "head_drag_surge": 0.053,
    "head_drag_yaw": 0.025,
    "link_drag_surge": 0.436,
    "fin_drag_surge": -0.582,
    "fin_drag_sway": 0.185,
}


def test_a_fit_beside_the_best_optimum_of_a_fine_tail_comes_there_reheated_and_the_best_stays():
    fish, random = with_links(Robot(), 5), np.random.default_rng(2)
    commands = np.stack([program(kind, 6.0, random) for kind in ("sines", "random")], axis=1)
    calm = Noise(gyro=0.003, accel=0.025, camera_position=0.001, camera_heading=0.006)
    swum = record(fish, commands, calm, random)[0]
    hypothesis, noise = nominal_hypothesis(fish), usual_noise(swum)
    truth = Coordinates(hypothesis).origin()
    beside = truth + [BESIDE.get(name, 0.0) for name in hypothesis.free]
    stuck = settle(evaluate(hypothesis, beside, swum, noise), swum)
    found = reheat(stuck, swum)
    best = settle(evaluate(hypothesis, truth, swum, found.noise), swum)
    assert best.objective - stuck.objective > 100.0
    assert abs(found.objective - best.objective) < 3.0
    assert reheat(best, swum).objective >= best.objective
