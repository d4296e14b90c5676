"""What a machine declares for identification, as the procedures run it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

import clutchest
from clutchest.errors import ClutchestError
from clutchest.identify import procedures
from clutchest.identify.delay_identification import _estimated
from clutchest.identify.parameters import procedure_of
from clutchest.models import machine_of
from clutchest.models.delay_relations import STEP, DelayRelation, DelayStretch, GriddedSignals
from clutchest.models.procedures import Procedure
from clutchest.signals import Floats
from clutchest.vehicle import Vehicle

LATE, BEHIND = 0.04, 0.03  # s
VEHICLE = cast(Vehicle, SimpleNamespace(parameters={"gain": SimpleNamespace(spread=0.5)}))


RNG, TIME = np.random.default_rng(1), np.arange(0.0, 60.0, STEP)
CAUSE = np.convolve(RNG.standard_normal(len(TIME)), np.hanning(60), mode="same")
DRIVE = GriddedSignals({"gain": 2.0}, {}, TIME, np.zeros(len(TIME), np.uint8))


def follows(late: float) -> Floats:
    """What follows the cause by twice as much, late and noisy."""
    return 2.0 * np.interp(TIME - late, TIME, CAUSE) + RNG.standard_normal(len(TIME))


EFFECT, FURTHER = follows(LATE), follows(BEHIND)


def stretches_of(effect: Floats):
    def stretches(drive: GriddedSignals, delays: Mapping[str, float]) -> list[DelayStretch]:
        rows = [np.arange(a, a + 300, 5) for a in range(200, 5600, 400)]
        gain = drive.parameters["gain"]
        known = gain * np.interp(drive.time + delays.get("effect", 0.0), drive.time, CAUSE)
        return [drive.stretch(each, effect, known, []) for each in rows]

    return stretches


def test_relations_chain_delays_and_their_uncertainty():
    first = DelayRelation("effect", "motion", stretches_of(EFFECT))
    delay = _estimated(first, [DRIVE], VEHICLE, {})
    assert delay is not None and abs(delay.value - LATE) < 4 * delay.std < 0.01
    widened = _estimated(replace(first, parameters=("gain",)), [DRIVE], VEHICLE, {})
    assert widened is not None and widened.value == delay.value and widened.std >= delay.std
    behind = DelayRelation("further", "motion", stretches_of(FURTHER), behind="effect")
    total = _estimated(behind, [DRIVE], VEHICLE, {"effect": delay})
    assert total is not None and abs(total.value - LATE - BEHIND) < 4 * total.std < 0.02
    assert total.std > delay.std
    after = DelayRelation("further", "motion", stretches_of(FURTHER), after=("effect",))
    for relation in (behind, after):
        assert _estimated(relation, [DRIVE], VEHICLE, {"effect": None}) is None
        assert _estimated(relation, [DRIVE], VEHICLE, {"effect": replace(delay, std=1.0)}) is None
    shifted = _estimated(after, [DRIVE], VEHICLE, {"effect": delay})
    assert shifted is not None  # its columns are moved by the delay that is given
    assert abs(shifted.value - BEHIND - delay.value) < 4 * shifted.std


def test_all_is_every_parameter_that_is_no_states_prior():
    truck = clutchest.load_vehicle("truck")
    keys = procedure_of("all", truck).parameters
    assert "zero_position_ref" not in keys and "expansion_disc" in keys
    assert all(truck.parameters[key].spread > 0 for key in keys)


def test_procedures_of_a_machine_without_any():
    bare = replace(machine_of("alsd"), experiments=())
    assert list(procedures(bare)) == ["noise", "all"]


@pytest.mark.parametrize(
    ("procedure", "words"),
    [
        (Procedure("p", "", ("expansion_dis",)), "no parameter 'expansion_dis'; did you mean"),
        (Procedure("p", "", (), sensor="zero"), "has no sensor 'zero'"),
    ],
)
def test_a_procedure_of_what_is_not_there_is_refused(procedure, words):
    with pytest.raises(ClutchestError, match="procedure 'p'") as error:
        replace(machine_of("dry_clutch"), procedures=(procedure,))
    assert words in str(error.value)


def test_a_reserved_name_is_refused_when_a_machine_is_made():
    machine = machine_of("dry_clutch")
    effects = {**machine.effects, "start": machine.effects["wear"]}
    with pytest.raises(ClutchestError, match="effects has 'start', which is a reserved name"):
        replace(machine, effects=effects)
