"""The command that makes the robot safe after a node was killed."""

import pytest
import yaml
from waiting import wait_until

from fish_hw.commands.safe_stop import main
from fish_hw.devices import vertiq_registers as reg
from fish_hw.emulators.pwm_chip import PwmChipEmulator
from fish_hw.emulators.vertiq import VELOCITY_MODE
from fish_hw.settings.parameter_file import read_parameter_file
from fish_hw.settings.rudder import RudderSettings


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
    assert wait_until(lambda: vertiq_emulator.mode == reg.COAST)
    assert vertiq_emulator.timeouts == 0
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 0)


def test_rudder_is_centred_though_the_rotor_is_gone(tmp_path, capsys):
    chip = PwmChipEmulator(tmp_path / "pwmchip0")
    rotor = parameter_file(tmp_path / "rotor.yaml", port="/dev/ttyX9")
    rudder = parameter_file(tmp_path / "rudder.yaml", chip=str(chip.chip), off_at_exit=False)
    assert main(["--rotor", str(rotor), "--rudder", str(rudder)]) == 1
    assert (chip.read("duty_cycle"), chip.read("enable")) == (1_500_000, 1)
    assert "safe_stop: rotor: cannot open serial port /dev/ttyX9" in capsys.readouterr().err


def test_nothing_named(capsys):
    with pytest.raises(SystemExit, match="2"):
        main([])
    assert "nothing to stop" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{bad: [", "while parsing"),
        ("[]", "expected a node name with ros__parameters"),
        ("/**: {ros__parameters: {chnnel: 1}}", "unknown chnnel; known: address"),
        ("/**: {ros__parameters: {pwm_hz: 3}}", "pwm_hz is 3, expected 40.0 to 333.0"),
        ("/**: {ros__parameters: {pwm_hz: fast}}", "rudder.yaml"),
    ],
)
def test_parameter_file_errors_name_file_and_field(tmp_path, text, expected):
    path = tmp_path / "rudder.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"rudder\.yaml") as caught:
        read_parameter_file(path, RudderSettings)
    assert expected in str(caught.value)
