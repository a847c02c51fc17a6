# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command that makes the robot safe after a node was killed."""

import struct
import time

import pytest
import yaml
from waiting import wait_until

from fish_hw.commands import safe_stop
from fish_hw.devices.rudder_output import open_output
from fish_hw.emulators.pwm import PwmChipEmulator
from fish_hw.emulators.vertiq import VELOCITY_MODE, VertiqEmulator
from fish_hw.protocol import iquart
from fish_hw.safe_stop import main
from fish_hw.settings import RudderSettings
from fish_hw.transport.interfaces import TransportError
from fish_hw.transport.sysfs_pwm import SysfsPwm
from fish_node.parameter_file import read_settings


def parameter_file(path, **parameters):
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}))
    return path


def test_both_are_stopped(tmp_path, vertiq_emulator):
    vertiq_emulator.mode, vertiq_emulator.commanded = VELOCITY_MODE, 50.0
    chip = PwmChipEmulator(tmp_path / "pwmchip0")
    for name, text in (("period", "20000000"), ("duty_cycle", "1900000"), ("enable", "1")):
        (chip.channel / name).write_text(text)
    rotor = parameter_file(tmp_path / "rotor.yaml", port=vertiq_emulator.port)
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip))
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 0
    assert wait_until(lambda: vertiq_emulator.mode == iquart.COAST)
    assert vertiq_emulator.timeouts == 0
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 0)


def test_the_module_of_the_file_is_stopped(tmp_path):
    emulator = VertiqEmulator(module=5)
    emulator.written[iquart.TIMEOUT.type, iquart.TIMEOUT.param] = struct.pack(
        "<f", 60.0
    )  # not by its own watchdog
    emulator.mode, emulator.commanded = VELOCITY_MODE, 50.0
    try:
        rotor = parameter_file(tmp_path / "rotor.yaml", port=emulator.port, module_id=5)
        assert main(["--rotor", str(rotor)]) == 0
        assert wait_until(lambda: emulator.mode == iquart.COAST)
        assert emulator.timeouts == 0
    finally:
        emulator.close()


def test_the_device_is_stopped_that_the_node_drives(tmp_path, capsys):
    """The node's own values, further down in the file, had not been read: another servo was centred, with success."""
    chips = [rudder_at_the_side(tmp_path / str(k)) for k in range(2)]
    rudder = tmp_path / "rudder.yaml"
    values = [{"ros__parameters": {"chip": str(chip.chip), "max_rate": 50.0}} for chip in chips]
    rudder.write_text(yaml.safe_dump({"/**": values[0], "/fish/rudder": values[1]}))
    assert main(["--rudder", str(rudder)]) == 0
    assert [(chip.read("duty_cycle"), chip.read("enable")) for chip in chips] == [
        (1_900_000, 1),
        (1_500_000, 0),
    ]
    rudder.write_text(
        yaml.safe_dump({"/red/fish/rudder": values[0], "/blue/fish/rudder": values[1]})
    )
    assert main(["--rudder", str(rudder)]) == 1
    assert chips[0].read("enable") == 1
    assert "does not read /blue/fish/rudder, /red/fish/rudder" in capsys.readouterr().err


@pytest.mark.parametrize("step", ["set_pulse_ns", "stop"])
def test_pulses_that_cannot_be_switched_off_are_a_failure(tmp_path, capsys, monkeypatch, step):
    def refuse(*_):
        raise TransportError("cannot write 0 to enable")

    monkeypatch.setattr(SysfsPwm, step, refuse)
    chip = rudder_at_the_side(tmp_path)
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip), max_rate=50.0)
    assert main(["--rudder", str(rudder)]) == 1
    assert chip.read("enable") == 1
    assert capsys.readouterr().err == "safe_stop: rudder: cannot write 0 to enable\n"


def test_rudder_is_centred_though_the_rotor_is_gone(tmp_path, capsys):
    chip = PwmChipEmulator(tmp_path / "pwmchip0")
    rotor = parameter_file(tmp_path / "rotor.yaml", port="/dev/ttyX9")
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip), off_at_exit=False)
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 1
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 1)
    assert "safe_stop: rotor: cannot open serial port /dev/ttyX9" in capsys.readouterr().err


def rudder_at_the_side(tmp_path) -> PwmChipEmulator:
    chip = PwmChipEmulator(tmp_path / "pwmchip0")
    for name, text in (("period", "20000000"), ("duty_cycle", "1900000"), ("enable", "1")):
        (chip.channel / name).write_text(text)
    return chip


@pytest.mark.parametrize("wrong", [{"module_id": 0.0}, {"baud": "fast"}, {"port": 7}])
def test_a_mistake_in_the_rotors_file_does_not_leave_the_rudder(tmp_path, capsys, wrong):
    chip = rudder_at_the_side(tmp_path)
    rotor = parameter_file(tmp_path / "rotor.yaml", **wrong)
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip))
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 1
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 0)
    error = capsys.readouterr().err
    assert f"{next(iter(wrong))} is" in error
    assert error.count("\n") == 1


def test_a_wrong_value_that_a_stop_does_not_need_keeps_nothing_from_being_stopped(
    tmp_path, vertiq_emulator
):
    vertiq_emulator.mode, vertiq_emulator.commanded = VELOCITY_MODE, 50.0
    chip = rudder_at_the_side(tmp_path / "side")
    rotor = parameter_file(tmp_path / "rotor.yaml", port=vertiq_emulator.port, battery_cells=40)
    wrong = {"armed_timeout_s": 9.0, "stale_s": "fast"}
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip), **wrong)
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 0
    assert wait_until(lambda: vertiq_emulator.mode == iquart.COAST)
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 0)


def test_what_nobody_expects_does_not_leave_the_rudder(tmp_path, capsys, monkeypatch):
    chip = rudder_at_the_side(tmp_path)
    monkeypatch.setattr(safe_stop, "SerialPort", lambda *_: 1 / 0)
    rotor = parameter_file(tmp_path / "rotor.yaml")
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip))
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 1
    assert chip.read("enable") == 0
    assert capsys.readouterr().err == "safe_stop: rotor: ZeroDivisionError('division by zero')\n"


def test_the_servo_gets_time_to_travel_before_the_pulses_end(tmp_path):
    """From one stop to the other, since the angle before is not known."""
    chip = rudder_at_the_side(tmp_path)
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip), max_rate=8.0)
    start = time.monotonic()
    assert main(["--rudder", str(rudder)]) == 0
    assert time.monotonic() - start >= 2 * 0.8 / 8.0


def test_emulated_devices_leave_the_real_ones_alone(tmp_path):
    chip = rudder_at_the_side(tmp_path)
    rotor = parameter_file(tmp_path / "rotor.yaml", port="emulator")
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip), backend="emulator")
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 0
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_900_000, 1)
    with pytest.raises(ValueError, match="no output to open"):
        open_output(RudderSettings(backend="emulator"))


def test_nothing_named(capsys):
    with pytest.raises(SystemExit, match="2"):
        main([])
    assert "nothing to stop" in capsys.readouterr().err


def test_unknown_parameters_are_said_but_the_robot_is_stopped(tmp_path, capsys, vertiq_emulator):
    vertiq_emulator.mode, vertiq_emulator.commanded = VELOCITY_MODE, 50.0
    chip = rudder_at_the_side(tmp_path)
    rotor = parameter_file(tmp_path / "rotor.yaml", port=vertiq_emulator.port, use_sim_time=True)
    rudder = parameter_file(
        tmp_path / "rudder.yaml", chip=str(chip.chip), chanel=1, **{"qos_overrides.x": 1}
    )
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 0
    assert wait_until(lambda: vertiq_emulator.mode == iquart.COAST)
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 0)
    error = capsys.readouterr().err
    assert error.startswith(
        f"safe_stop: rudder: {rudder}: unknown parameter chanel (did you mean channel?); known: "
    )
    assert error.count("\n") == 1


def test_names_that_are_no_words_are_left_out(tmp_path):
    path, said = tmp_path / "rudder.yaml", []
    path.write_text("/**: {ros__parameters: {1: 1, false: 2, channel: 3}}")
    assert read_settings(path, "/fish/rudder", RudderSettings, said.append).channel == 3
    assert len(said) == 1
    assert "unknown parameter 1, False; known: " in said[0]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{bad: [", "while parsing"),
        ("[]", "expected a node name with ros__parameters"),
        ("/fish/rotor: {ros__parameters: {module_id: 3}}", "nothing for the node /fish/rudder"),
        (
            "/red/fish/rudder: {ros__parameters: {}}\n/fish/rudder: {ros__parameters: {}}",
            "of one robot only",
        ),
        ("/**: {ros__parameters: {pwm_hz: 3}}", "pwm_hz is 3.0, expected 40.0 to 333.0"),
        ("/**: {ros__parameters: {pwm_hz: fast}}", "pwm_hz is 'fast', expected float such as 50.0"),
        ("/**: {ros__parameters: {channel: 0.0}}", "channel is 0.0, expected int such as 0"),
    ],
)
def test_parameter_file_errors_name_file_and_field(tmp_path, text, expected):
    path = tmp_path / "rudder.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"rudder\.yaml") as caught:
        read_settings(path, "/fish/rudder", RudderSettings, pytest.fail)
    assert expected in str(caught.value)
