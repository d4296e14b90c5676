"""Backward elimination of causes that held-out drives do not confirm."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from clutchest.discovery import verdict
from clutchest.discovery.search import Search


@dataclass(frozen=True)
class Reducible:
    """What of a search a verdict asks."""

    best: SimpleNamespace
    rivals: tuple
    by_count: dict
    tied: tuple = ()
    null: SimpleNamespace = field(default_factory=lambda: SimpleNamespace(cost=100.0))
    problem: SimpleNamespace = field(default_factory=lambda: SimpleNamespace(discrepancies=()))
    clear = False

    def released(self, h):
        return h

    def free(self, causes):
        return []


DOUBTFUL, SURELY = 1e-3, 1e-12  # chances of noise


def a_set(causes, cost: float = 0.0) -> SimpleNamespace:
    causes = tuple(causes)
    names = [c.name for c in causes]
    return SimpleNamespace(causes=causes, names=frozenset(names), effects=tuple(names), cost=cost)


class Searched:
    """A search that ended with these causes, name → chance of noise."""

    def __init__(self, p_of: dict[str, float]) -> None:
        self.p_of = p_of
        self.best = a_set(SimpleNamespace(name=name, index=i) for i, name in enumerate(p_of))

    def established(self, cause, of):
        assert of is self.best
        return 50.0, self.p_of[cause.name]

    def without(self, cause, of):
        assert of is self.best
        return a_set(c for c in of.causes if c is not cause)

    def reduced_to(self, fewer):
        reduced = Searched(self.p_of)
        reduced.best = fewer
        return reduced

    def margin(self, than):
        return -2.0


def backward_eliminated(monkeypatch, p_of, gains):
    """Names that are left, and those taken back; ``gains``: what each brings on other drives."""
    search = Searched(p_of)

    def held_out_gain(search, best, other, than):
        (gone,) = {c.name for c in best.causes} - {c.name for c in than.causes}
        return SimpleNamespace(total=gains[gone])

    monkeypatch.setattr(verdict, "held_out_gain", held_out_gain)
    search, dropped = verdict.backward_eliminated(search, lambda: None)
    assert set(dropped.values()) <= {50.0}, "what each had improved the fit by"
    return {c.name for c in search.best.causes}, [*dropped]


@pytest.mark.parametrize(("gain", "kept"), [(5.0, True), (0.5, False), (-5.0, False)])
def test_a_doubtful_cause_must_be_confirmed(monkeypatch, gain, kept):
    gains = {"a": 9.0, "b": gain}
    left, dropped = backward_eliminated(monkeypatch, {"a": SURELY, "b": DOUBTFUL}, gains)
    assert left == ({"a", "b"} if kept else {"a"})
    assert dropped == ([] if kept else ["b"])


@pytest.mark.parametrize(("gain", "kept"), [(9.0, True), (-24.0, True), (-26.0, False)])
def test_an_established_cause_stays_unless_it_costs_more_than_it_explained(monkeypatch, gain, kept):
    """It explains 50 in 2 Δ ln L; what it costs on other drives is in ln L."""
    gains = {"a": 9.0, "b": gain}
    left, dropped = backward_eliminated(monkeypatch, {"a": SURELY / 10, "b": SURELY}, gains)
    assert left == ({"a", "b"} if kept else {"a"})
    assert dropped == ([] if kept else ["b"])


def test_the_most_doubtful_goes_first_and_the_last_one_stays(monkeypatch):
    p_of = {"a": DOUBTFUL, "b": 2 * DOUBTFUL, "c": 4 * DOUBTFUL}
    left, dropped = backward_eliminated(monkeypatch, p_of, dict.fromkeys(p_of, -1.0))
    assert left == {"a"}
    assert dropped == ["c", "b"]


def test_the_rest_is_judged_anew():
    """One of as many causes that was tried may be more likely than what is left."""
    a, b, c = (SimpleNamespace(name=name, index=i) for i, name in enumerate("abc"))
    tried = (a_set([b], 12.0), a_set([a], 15.0), a_set([c], 18.0))
    search = Reducible(best=a_set([a, b], 5.0), rivals=(), by_count={1: tried})
    reduced = Search.reduced_to(search, a_set([a], 14.0))
    assert [h.names for h in (reduced.best, *reduced.rivals)] == [{"b"}, {"a"}, {"c"}]
    assert [h.cost for h in reduced.by_count[1]] == [12.0, 14.0, 18.0]
    kept = Search.reduced_to(search, a_set([a], 11.0))
    assert kept.best.names == {"a"} and kept.best.cost == 11.0


def judged_by(monkeypatch, residual_errors, held) -> None:
    """Verdicts of errors as they are given, beside one cause whose form is ``held``."""
    monkeypatch.setattr(verdict, "_residual_errors", residual_errors)
    monkeypatch.setattr(verdict, "tested_forms", lambda search, of, wider=False: {"a": held})
    monkeypatch.setattr(
        verdict, "located", lambda _, errors, by: SimpleNamespace(errors=errors, fitted=True)
    )
    monkeypatch.setattr(
        verdict, "several_errors", lambda place, free, level: verdict.Errors([], [])
    )


@pytest.mark.parametrize(("worth", "unnamed"), [(60.0, True), (40.0, False)])
def test_a_curve_must_explain_more_than_what_was_dropped(monkeypatch, worth, unnamed):
    """Held-out drives have denied what improved the fit by 50."""
    a = SimpleNamespace(name="a", index=0, effect=SimpleNamespace(equation="torque"))
    search = Reducible(best=a_set([a], 5.0), rivals=(), by_count={})
    curve = SimpleNamespace(worth=worth, p_value=1e-9, covariate="time", equation="torque")
    held = SimpleNamespace(form=SimpleNamespace(refuted=False))
    judged_by(monkeypatch, lambda search, of, equations=(): [curve], held)
    said = verdict._verdict(search, {}, [curve], {"b": 50.0}, verdict.UNNAMED)
    assert said.name == ("unknown" if unnamed else "named")
    assert said.dropped == ["b"]
    assert verdict._verdict(search, {}, [curve], {}, verdict.UNNAMED).name == "unknown"


@pytest.mark.parametrize(
    ("p", "other", "found"),
    [
        (5e-5, True, "unknown"),
        (5e-5, False, "none"),
        (5e-6, False, "unknown"),
        (5e-4, True, "none"),
    ],
)
def test_an_error_that_no_held_out_drive_can_reject_must_be_established(
    monkeypatch, p, other, found
):
    nothing = a_set([], 100.0)
    search = Reducible(best=nothing, rivals=(), by_count={})
    curve = SimpleNamespace(worth=30.0, p_value=p, covariate="time")
    for name, said in {
        "errors_without_causes": lambda search, equations=(): [curve],
        "model_in_alternative_mode": lambda search: None,
        "run": lambda search, progress: search,
        "cause_in_alternative_mode": lambda search: (search, False),
        "backward_eliminated": lambda search, other: (search, {}),
        "refine": lambda search: (search, {}),
        "fewer_causes": lambda search: None,
        "tested_forms": lambda search, of, wider=False: {},
        "located": lambda _, errors, by: SimpleNamespace(errors=errors, fitted=True),
        "several_errors": lambda place, free, level: verdict.Errors([], []),
        "_beside_less_discrepancies": lambda search: [],
    }.items():
        monkeypatch.setattr(verdict, name, said)
    assert verdict.judge(search, (lambda: None) if other else None, None).name == found


@pytest.mark.parametrize(
    ("worth", "refuted", "causes", "asked"),
    [
        (9.0, False, 1, ("torque",)),
        (11.0, False, 1, ("torque", "disc_heat")),
        (9.0, True, 1, ()),
        (9.0, False, 2, ()),
    ],
)
def test_other_equations_are_asked_where_they_can_explain_more(worth, refuted, causes, asked):
    """Beside a single cause whose form holds, some curve improves the fit clearly, or none does."""
    a = SimpleNamespace(name="a", index=0, effect=SimpleNamespace(equation="torque"))
    forms = {"a": SimpleNamespace(form=SimpleNamespace(refuted=refuted))}
    curves = ((worth, "disc_heat"), (-3.0, "zero_position"))
    remaining = [SimpleNamespace(worth=size, equation=where) for size, where in curves]
    assert verdict._asked(a_set([a] * causes), forms, remaining) == asked


@pytest.mark.parametrize(("other", "elsewhere"), [(75.0, False), (95.0, True)])
def test_a_refuted_cause_is_elsewhere_where_another_curve_explains_clearly_more(other, elsewhere):
    effect = SimpleNamespace(equation="torque")
    best = a_set([SimpleNamespace(name="a", index=0, effect=effect)], 5.0)
    forms = {"a": SimpleNamespace(drivers=("slip_speed",))}
    curves = [
        SimpleNamespace(worth=other, equation="sensor", covariate="engine_speed"),
        SimpleNamespace(worth=70.0, equation="torque", covariate="slip_speed"),
    ]
    assert verdict._elsewhere(best, forms, curves) == elsewhere


def test_an_error_elsewhere_that_explains_as_much_as_a_free_form_is_as_likely():
    cause = SimpleNamespace(name="a", index=0, effect=SimpleNamespace(equation="torque"))
    best = a_set([cause], 60.0)
    search = SimpleNamespace(null=SimpleNamespace(cost=100.0))
    tested = SimpleNamespace(drivers=("slip_speed",), worth=30.0)
    curves = [
        SimpleNamespace(worth=worth, equation=equation, covariate="engine_speed")
        for equation, worth in (("sensor", 68.0), ("torque", 50.0), ("sensor", 20.0))
    ]
    more = verdict._more_than_form(search, best, "a", tested, curves)
    assert more == {"sensor": -2.0, "torque": -20.0}


@pytest.mark.parametrize(("p", "found"), [(0.02, "named"), (0.008, "unknown")])
def test_a_curve_outranks_a_cause_only_where_something_is_left_beside_it(monkeypatch, p, found):
    """It explains 20 more in 2 Δ ln L, five knots as against one number."""
    effect = SimpleNamespace(equation="sensor", name="a")
    cause = SimpleNamespace(name="a", index=0, effect=effect)
    search = Reducible(best=a_set([cause], 45.0), rivals=(), by_count={})

    def errors_beside(search, of, equations=()):
        of_search = SimpleNamespace(worth=75.0, p_value=1e-12, covariate="b", equation="sensor")
        beside = SimpleNamespace(worth=15.0, p_value=p, covariate="b", equation="sensor")
        return [of_search if of is search.null else beside]

    held = SimpleNamespace(form=SimpleNamespace(refuted=False), drivers=("b",), worth=0.0)
    judged_by(monkeypatch, errors_beside, held)
    assert verdict._verdict(search, {}, [], {}, verdict.UNNAMED).name == found
