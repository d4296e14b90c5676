"""Backward elimination of causes that held-out drives do not confirm."""

from types import SimpleNamespace

import pytest

from clutchest.discovery import verdict

DOUBTFUL, SURELY = 1e-3, 1e-12  # chances of noise


class Searched:
    """A search that ended with these causes, name → chance of noise."""

    def __init__(self, p_of: dict[str, float]) -> None:
        self.p_of = p_of
        self.best = SimpleNamespace(
            causes=tuple(SimpleNamespace(name=name, index=i) for i, name in enumerate(p_of))
        )

    def established(self, cause, of):
        assert of is self.best
        return 50.0, self.p_of[cause.name]

    def without(self, cause, of):
        assert of is self.best
        return SimpleNamespace(causes=tuple(c for c in of.causes if c is not cause))

    def reduced_to(self, fewer):
        reduced = Searched(self.p_of)
        reduced.best = fewer
        return reduced

    def keeps_best(self, more, than):
        return more > 2.0


def backward_eliminated(monkeypatch, p_of, gains):
    """Names that are left, and those taken back; ``gains``: what each brings on other drives."""
    search = Searched(p_of)

    def held_out_gain(search, best, other, than):
        (gone,) = {c.name for c in best.causes} - {c.name for c in than.causes}
        return SimpleNamespace(total=gains[gone])

    monkeypatch.setattr(verdict, "held_out_gain", held_out_gain)
    search, dropped = verdict.backward_eliminated(search, lambda: None)
    return {c.name for c in search.best.causes}, dropped


@pytest.mark.parametrize(("gain", "kept"), [(5.0, True), (0.5, False), (-5.0, False)])
def test_a_doubtful_cause_must_be_confirmed(monkeypatch, gain, kept):
    left, dropped = backward_eliminated(monkeypatch, {"a": SURELY, "b": DOUBTFUL}, {"b": gain})
    assert left == ({"a", "b"} if kept else {"a"})
    assert dropped == ([] if kept else ["b"])


def test_what_is_beyond_doubt_is_not_asked(monkeypatch):
    left, dropped = backward_eliminated(monkeypatch, {"a": SURELY, "b": SURELY}, {})
    assert (left, dropped) == ({"a", "b"}, [])


def test_the_most_doubtful_goes_first_and_the_last_one_stays(monkeypatch):
    p_of = {"a": DOUBTFUL, "b": 2 * DOUBTFUL, "c": 4 * DOUBTFUL}
    left, dropped = backward_eliminated(monkeypatch, p_of, dict.fromkeys(p_of, -1.0))
    assert left == {"a"}
    assert dropped == ["c", "b"]
