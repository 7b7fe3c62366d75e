"""Drives of a machine file: compatible with old files, and one clear message for each mistake."""

import pytest
from machine_with_bearing import with_bearing

from wm_drake.errors import InputError
from wm_drake.parameters import load_machine, machine_yaml, quantities

DRIVE = """extends: motor
name: own
drive:
"""


def read(tmp_path, text):
    (tmp_path / "own.yaml").write_text(text)
    return load_machine(tmp_path / "own.yaml")


def test_a_drive_without_kind_is_prescribed(tmp_path):
    plain = read(tmp_path, "extends: reference\nname: own\ndrive: {joint: drum_axis}\n")
    assert (plain.drive.kind, plain.drive.joint) == ("prescribed", "drum_axis")
    assert load_machine("reference").drive.kind == "prescribed"


def test_the_shipped_motor_has_a_source_for_each_number_and_survives_a_file(tmp_path):
    machine = load_machine("motor")
    keys = [key for key, _, _ in quantities(machine) if key.startswith("drive.")]
    assert len(keys) == 9
    assert all(machine.sources[key].startswith("assumption") for key in keys)
    again = read(tmp_path, machine_yaml(machine))
    assert again.drive == machine.drive


def test_a_motor_with_a_compliant_bearing_is_refused():
    with pytest.raises(ValueError, match=r"drive\.kind: 'motor' needs a rigid bearing .* remove"):
        with_bearing(load_machine("motor"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("  kind: steam", r"drive: kind must be 'prescribed' or 'motor', is 'steam'"),
        ("  belt_ratio: -3", r"drive\.belt_ratio: '-3' is out of range; allowed is >= 1"),
        ("  rotor_inertia: -1 kg*m^2", r"drive\.rotor_inertia: .* allowed is >= 0"),
        ("  torque_limit: {torque: 0 N*m}", r"drive\.torque_limit\.torque: .* allowed is > 0"),
        (
            "  torque_limit: {speed: '(0, 500) rpm', torque: '(2) N*m'}",
            r"drive\.torque_limit: needs as many speeds as torques, at least two; has 2 and 1",
        ),
        (
            "  torque_limit: {speed: '(0, 500, 400) rpm', torque: '(2, 1, 1) N*m'}",
            r"drive\.torque_limit: speed must rise from point to point",
        ),
        ("  torque_limit: {speed: '(10, 500) rpm', torque: '(2, 1) N*m'}", r"drive\.torque_limit: the first speed must be 0 rpm"),
        ("  torque_limit: {speed: '(0, 500) rpm', torque: '(2, -1) N*m'}", r"drive\.torque_limit: torque must not be negative"),
        ("  controller: {sample_time: 0 s}", r"drive\.controller\.sample_time: .* >= 0\.0001"),
        ("  controller: {proportional_gain: 0 N*m*s/rad}", r"proportional_gain: .* allowed is > 0"),
        (
            "  controller: {sample_time: 0.1 s, tracking_time: 0.01 s}",
            r"drive\.controller: sample_time: 0\.1 s is longer than .* anti-windup, 0\.01 s",
        ),
        ("  belt_ratios: 3", r"drive\.belt_ratios: unknown key 'belt_ratios'"),
    ],
)  # fmt: skip
def test_mistakes_get_one_message(tmp_path, change, message):
    with pytest.raises(InputError, match=message) as found:
        read(tmp_path, DRIVE + change + "\n")
    assert len(found.value.problems) == 1
    assert len(str(found.value)) < 300 + len(str(tmp_path))
