"""A model as a value: its equations are written out once, those of another model anew."""

from __future__ import annotations

from clutchest.models import machine_of


def test_equations_are_written_out_once():
    machine = machine_of("dry_clutch")
    model = machine.equations(machine.units)
    assert model.expressions() is model.expressions()


def test_another_model_has_equations_of_its_own():
    machine = machine_of("dry_clutch")
    model = machine.equations(machine.units)
    model.expressions()
    faded = model.with_effects((machine.effects["friction_fade"],))
    assert faded.expressions().g.numel() == 2 and model.expressions().g.numel() == 0
