"""Discovery on the differential, whose motor is tracked."""

from __future__ import annotations

import pytest

import clutchest

DURATION = 30.0
RESERVATION = clutchest.load_vehicle("alsd_rig").machine.reservations["discover"]


@pytest.mark.slow
def test_a_healthy_specimen_has_no_error():
    signals = clutchest.simulate("alsd_rig", "rig-steps", 41, duration=DURATION)
    found = clutchest.discover(signals, "alsd_rig")
    assert found.verdict == "none"
    assert not found.fit.rejects
    assert RESERVATION in found.warnings
    excited = {each.effect for each in found.identifiability if each.excited}
    assert {"current_gain", "supply_drop", "motor_friction"} <= excited


@pytest.mark.slow
def test_a_current_sensor_that_reads_high_is_named():
    hidden = {"current_gain": {"change": 0.12}}
    signals = clutchest.simulate("alsd_rig", "rig-steps", 42, hidden, duration=DURATION)
    found = clutchest.discover(signals, "alsd_rig")
    assert (found.verdict, found.sets) == ("named", (("current_gain",),))
    size = found.causes[0].parameters["change"]
    assert size.value == pytest.approx(0.12, abs=3.0 * size.std)
    assert found.gain is not None and found.gain.ci95[0] > 0.0


class CutOff:
    """A drag that goes with slip until the plates touch."""

    def law(self):
        return lambda seen: {"film": 0.5 * seen["slip_speed"] * (seen["plate"] < seen["free_play"])}

    def readings(self, true):
        return true


@pytest.mark.slow
def test_what_a_wrong_form_of_a_strong_cause_leaves_is_no_second_cause():
    """A friction over the oil's temperature made up for a drag that ends at contact."""
    signals = clutchest.simulate("alsd_rig", "coast", 43, duration=60.0, outsider=CutOff())
    found = clutchest.discover(signals, "alsd_rig")
    assert found.sets == (("viscous_drag",),)
    assert found.causes[0].form.refuted
    assert found.causes[0].form.curve.covariate in ("gap", "pack_force")
