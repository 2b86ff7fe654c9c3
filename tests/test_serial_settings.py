"""What the checks of a serial arm's logs change in its diagnosis."""

from __future__ import annotations

from armgap.check import Check
from armgap.diagnosis.serial_settings import serial_settings


def noticed(name: str) -> Check:
    return Check(name, "warning", "a sentence", (), 1)


def test_nothing_noticed_changes_nothing() -> None:
    assert serial_settings([]) == ({"known_units": True}, ())


def test_filtered_positions_are_judged_on_slow_motion() -> None:
    settings, notes = serial_settings([noticed("filtered_positions")])
    assert settings["half_width"] > 0.1
    assert settings["known_units"]
    assert not notes


def test_a_unit_from_the_arm_file_is_no_ground_for_masses() -> None:
    settings, [note] = serial_settings([noticed("torque_unit")])
    assert not settings["known_units"]
    assert "half_width" not in settings
    assert "torque gain" in note
