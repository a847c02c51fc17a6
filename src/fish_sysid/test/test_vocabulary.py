# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which names there are, and which of them recordings can judge."""

from dataclasses import replace

import numpy as np
from swims import GIVEN, swim

from fish_sim.effects import EFFECTS
from fish_sysid.diagnosis.vocabulary import candidates, kind_of, known, not_excited

VOCABULARY = """quadratic_drag current nonuniform_current wall_effect tip_slip wake_memory wave_drag
sloshing hull_asymmetry tail_hardening tail_joint_damping dry_friction tether payload rotor_imbalance
rudder_lag rudder_delay rudder_backlash rudder_offset rudder_saturation rudder_gain rudder_placement
rotor_lag rotor_saturation battery_sag camera_latency camera_heading_offset camera_scale gyro_scale
imu_misalignment""".split()


def test_the_vocabulary_is_complete_and_every_name_has_a_kind():
    assert set(VOCABULARY) == set(candidates())
    assert {kind_of(name) for name in VOCABULARY} == {"physics", "actuator", "sensor"}
    assert known(["current", "tether", "current"]) == ("current", "tether")


def test_a_table_of_ones_own_adds_a_name():
    effects = {**EFFECTS, "mine": EFFECTS["quadratic_drag"]}
    assert "mine" in candidates(effects)
    assert kind_of("mine", effects) == "physics"
    assert "mine" not in candidates()


def reasons(experiment, why):
    return {name for name, reason in not_excited(experiment).items() if reason == why}


def test_what_is_not_excited_is_not_judged():
    still = swim(GIVEN, kinds=("straight", "straight"), duration=2.0)
    unseen = reasons(still, "the rudder never moved")
    assert {"rudder_lag", "rudder_gain", "rudder_placement"} <= unseen
    assert not {"rudder_offset", "current"} & set(not_excited(still))
    blind = replace(still, gyro=np.full_like(still.gyro, np.nan))
    assert not_excited(blind)["gyro_scale"] == "no IMU was recorded"
    drifting = replace(still, commands=still.commands * [0.0, 1.0])
    rotor = {"rotor_lag", "rotor_saturation", "battery_sag", "rotor_imbalance"}
    assert reasons(drifting, "the rotor never moved") == rotor


def test_padding_is_no_command():
    still = swim(GIVEN, kinds=("straight", "straight"), duration=2.0)
    held = np.stack([still.commands[..., 0], np.full_like(still.commands[..., 1], 0.2)], axis=-1)
    held[150:, 1] = 0.0  # pads a trial of 1.5 s
    turned = replace(still, commands=held, steps=still.steps - [0, len(held) - 150])
    moving = {"rudder_lag", "rudder_delay", "rudder_backlash"}
    assert reasons(turned, "the rudder's command never changed") == moving
