"""What a search tries."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from clutchest.discovery.candidates import CandidateCause, candidates, settings
from clutchest.models import machine_of
from clutchest.models.effects import Effect, Number


class Bumpy(Effect):
    """Two gains, two shapes with grids and one without."""

    name = "bumpy"
    model = "dry_clutch"
    equation = "torque"
    parameters = (
        Number("up", "1", 0.0, 0.5),
        Number("width", "s", 1.0, 9.0, shape=True, default=2.0, grid=(1.0, 3.0, 9.0)),
        Number("down", "1", -0.5, 0.5),
        Number("place", "s", 1.0, 9.0, shape=True, default=7.0),
        Number("height", "m", 1.0, 9.0, shape=True, default=2.0, grid=(4.0, 5.0)),
    )


def problem(*effects: Effect) -> Any:
    """As much of a problem as candidates look at: gains in order."""
    order = [f"{e.name}.{n.key}" for e in effects for n in e.gains]
    return SimpleNamespace(effects={e.name: e for e in effects}, index=order.index)


def test_every_gain_at_every_value_of_every_shape():
    found = candidates(problem(Bumpy()))
    assert len(found) == 2 * 3 * 1 * 2
    assert len(set(found)) == len(found)
    assert {c.shapes for c in found} == {
        (("width", w), ("place", 7.0), ("height", h)) for w in (1.0, 3.0, 9.0) for h in (4.0, 5.0)
    }
    assert {(c.gain.key, c.index) for c in found} == {("up", 0), ("down", 1)}
    assert {c.name for c in found} == {"bumpy"}


def test_the_whole_library():
    effects = tuple(machine_of("dry_clutch").effects.values())
    found = candidates(problem(*effects))
    assert {c.name for c in found} == set(machine_of("dry_clutch").effects)
    for effect in effects:
        own = [c for c in found if c.name == effect.name]
        assert {c.gain for c in own} == set(effect.gains)
        if not any(n.shape for n in effect.parameters):
            assert [c.shapes for c in own] == [()] * len(effect.gains)
    slip = [dict(c.shapes)["speed"] for c in found if c.name == "friction_slip"]
    assert slip == [5.0, 10.0, 20.0, 40.0]
    for c in found:
        grids = {n.key: n.grid for n in c.effect.parameters if n.shape}
        assert dict(c.shapes).keys() == grids.keys()
        assert all(value in grids[key] for key, value in c.shapes)


def test_settings_are_the_shapes_of_those_chosen():
    every = candidates(problem(Bumpy(), *machine_of("dry_clutch").effects.values()))
    bump = next(c for c in every if c.name == "bumpy")
    fade = next(c for c in every if c.name == "friction_fade" and c.shapes == (("onset", 160.0),))
    plain = next(c for c in every if c.name == "friction_speed")
    assert settings(()) == {}
    assert settings((plain,)) == {}
    assert settings((plain, fade, bump)) == {
        ("friction_fade", "onset"): 160.0,
        ("bumpy", "width"): 1.0,
        ("bumpy", "place"): 7.0,
        ("bumpy", "height"): 4.0,
    }


def test_a_candidate_is_a_value():
    one, two = candidates(problem(Bumpy())), candidates(problem(Bumpy()))
    assert isinstance(one[0], CandidateCause)
    with pytest.raises(AttributeError):
        one[0].index = 3  # type: ignore[misc]
    assert one[0].shapes == two[0].shapes
