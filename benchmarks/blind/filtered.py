"""Lines of the table about cases in which the drive could show at best so much (d′), or so little
else: they say what the method makes of what there is to see."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq, minimize
from scipy.stats import norm

from blind.first_run import placed, right
from blind.plan import gains
from blind.row import NOMINAL, Record, Row, share
from blind.utility import of_record
from clutchest.signals import Floats

NAMED, FAR, LEFT = 12.0, 4.0, 8.0  # d′: to be named, apart, left of an outsider
TOLD = 0.9  # of a d′ aimed at, what counts as having come out
USEFUL = 0.95  # m_utl
STEEPEST = 30.0  # of the logistic curves over ln d′


def filtered(records: Sequence[Record]) -> list[Row]:
    """Every such line."""
    return [
        *detection(records),
        *naming(records),
        *ambiguity(records),
        *outsiders(records),
        *pairs(records),
        *gain(records),
        *coverage(records),
    ]


def detection(records: Sequence[Record]) -> list[Row]:
    """d′ found in half of the runs over that of the oracle, effect by effect."""
    seen = [r for r in records if r["part"] == "effect" and r["reached"] > 0.5]
    causes = sorted({r["cause"] for r in seen})
    if not causes:
        return [Row("detection: median ratio", "≤ 1.6"), Row("detection: worst ratio", "≤ 2.0")]
    of = np.array([causes.index(r["cause"]) for r in seen])
    d = np.log([r["reached"] for r in seen])
    hit = np.array([r["verdict"] in ("named", "ambiguous", "unknown") for r in seen])
    half, slope = logistic(of, d, hit, len(causes))
    one_sided = {r["cause"]: r["one_sided"] for r in seen}
    oracle = np.array([norm.isf(NOMINAL / (1 if one_sided[c] else 2)) for c in causes])
    ratio = np.exp(half) / oracle
    alike, _ = logistic(np.zeros_like(of), d - np.log(oracle[of]), hit, 1)
    worst = int(np.argmax(ratio))
    low, high = (
        float(np.exp(limit) / oracle[worst])
        for limit in limits(d[of == worst], hit[of == worst], half[worst], slope)
    )
    each = [
        Row(f"detection: {cause}", "", int(np.sum(of == i)), float(ratio[i]))
        for i, cause in enumerate(causes)
    ]
    median = float(np.median(ratio))
    return [
        Row("detection: median ratio", "≤ 1.6", len(seen), median, passed=median <= 1.6),
        Row(
            "detection: ratio, if it were that of all effects",
            "",
            len(seen),
            float(np.exp(alike[0])),
        ),
        Row(
            f"detection: worst ratio, {causes[worst]}",
            "lower bound ≤ 2.0",
            int(np.sum(of == worst)),
            float(ratio[worst]),
            low,
            high,
            low <= 2.0,
        ),
        *each,
    ]


def logistic(of: Floats, d: Floats, hit: Floats, count: int) -> tuple[Floats, float]:
    """ln d′ of half the runs for each of ``count`` effects, and the slope they share; by maximum
    likelihood, within half a step of the d′ that were tried."""

    def cost(x: Floats) -> float:
        return -log_likelihood(d, hit, x[of], np.exp(x[-1]))

    begin = np.r_[np.full(count, np.median(d)), 1.5]
    bounds = [(d.min() - 0.5, d.max() + 0.5)] * count + [(0.0, np.log(STEEPEST))]
    best = minimize(cost, begin, bounds=bounds)
    return best.x[:-1], float(np.exp(best.x[-1]))


def log_likelihood(d: Floats, hit: Floats, half: Floats | float, slope: float) -> float:
    """Of hits that follow a logistic curve over ``d``."""
    z = np.where(hit, 1.0, -1.0) * slope * (d - half)
    return float(-np.sum(np.logaddexp(0.0, -z)))


def limits(d: Floats, hit: Floats, half: float, slope: float) -> tuple[float, float]:
    """95 % interval of one ``half`` at a given slope, from its likelihood; infinite where no hit,
    or no miss, bounds it."""
    top = log_likelihood(d, hit, half, slope)

    def over(x: float) -> float:
        return 2.0 * (top - log_likelihood(d, hit, x, slope)) - 3.841

    found = []
    for direction in (-1.0, 1.0):
        far = half + direction * 5.0
        found.append(brentq(over, half, far) if over(far) > 0 else direction * np.inf)
    return found[0], found[1]


def large(records: Sequence[Record]) -> list[Record]:
    """Single effects that are to be named."""
    return [r for r in records if r["part"] == "effect" and r["reached"] >= TOLD * NAMED]


def naming(records: Sequence[Record]) -> list[Row]:
    apart = [r for r in large(records) if r["nearest"] is not None and r["nearest"] >= FAR]
    hidden = [r for r in records if r["part"] == "effect" and r["hidden_unexcited"]]
    return [
        share(
            "effects, d′ ≥ 10.8, rivals d′ ≥ 4 away: named right",
            "≥ 95 %",
            [right(r) for r in apart],
            lambda p: p >= 0.95,
        ),
        share(
            "unexcited effect: none, and listed",
            "",
            [r["verdict"] == "none" and r["truth"][0] in (r["unexcited"] or []) for r in hidden],
            lambda p: True,
        ),
    ]


def ambiguity(records: Sequence[Record]) -> list[Row]:
    alike = [r for r in large(records) if r["alike"]]
    inside = [r for r in alike if r["truth"][0] in r["causes"]]
    after, of_any_size = (
        [r["followed_up"]["right"] for r in of if r["followed_up"]]
        for of in (alike, [r for r in records if r["part"] == "effect"])
    )
    size = Row("ambiguous: mean size over the oracle's", "≤ 1.3")
    if inside:
        ratio = float(
            np.sum([len(r["causes"]) for r in inside])
            / np.sum([1 + len(r["alike"]) for r in inside])
        )
        size = Row(size.what, size.must, len(inside), ratio, passed=ratio <= 1.3)
    return [
        share(
            "ambiguous: truth inside, rivals d′ < 2 away",
            "≥ 95 %",
            [r["truth"][0] in r["causes"] for r in alike],
            lambda p: p >= 0.95,
        ),
        size,
        utility(alike),
        share("ambiguous: right after the manoeuvre", "≥ 90 %", after, lambda p: p >= 0.90),
        share(
            "ambiguous, any size: right after the manoeuvre",
            "≥ 90 %",
            of_any_size,
            lambda p: p >= 0.90,
        ),
    ]


def utility(alike: Sequence[Record]) -> Row:
    """Mean of m_utl with the interval of its standard error."""
    what, must = "ambiguous: m_utl, rivals d′ < 2 away", "≥ 0.95"
    if len(alike) < 2:
        return Row(what, must)
    parts = len({gain.split(".")[0] for gain in gains()})
    each = np.array([of_record(record, parts) for record in alike])
    mean, error = float(each.mean()), float(each.std(ddof=1) / np.sqrt(len(each)))
    low, high = mean - 1.96 * error, mean + 1.96 * error
    return Row(what, must, len(each), mean, low, high, mean >= USEFUL, high < USEFUL)


def left_over(records: Sequence[Record]) -> list[Record]:
    """Outsiders of which enough is left when every single effect has been tried."""
    return [r for r in records if r["part"] == "outsider" and r["reached"] >= LEFT]


def outsiders(records: Sequence[Record]) -> list[Row]:
    near = [r for r in records if r["part"] == "near-miss" and r["reached"] >= LEFT]
    return [
        *placed(left_over(records), "outsiders, d′ ≥ 8 left"),
        *placed(near, "near misses, d′ ≥ 8 left"),
    ]


def pairs(records: Sequence[Record]) -> list[Row]:
    two = [
        r
        for r in records
        if r["part"] == "two"
        and r["reached"] >= LEFT
        and r["nearest"] is not None
        and r["nearest"] >= FAR
    ]
    return [
        share(
            "pairs, d′ ≥ 8 each, rivals d′ ≥ 4 away: both named",
            "≥ 85 %",
            [right(r) for r in two],
            lambda p: p >= 0.85,
        )
    ]


def gain(records: Sequence[Record]) -> list[Row]:
    measured = [r for r in records if r.get("gained") is not None]
    kinds = (
        (
            "named",
            "≥ 0.90",
            0.90,
            [r for r in measured if r["verdict"] == "named" and r["part"] in ("effect", "two")],
        ),
        (
            "unknown, patched",
            "≥ 0.60",
            0.60,
            [r for r in measured if r["verdict"] == "unknown" and r["part"] == "outsider"],
        ),
    )
    found = []
    for what, must, least, of in kinds:
        if of:
            ratio = float(np.sum([r["gained"] for r in of]) / np.sum([r["possible"] for r in of]))
            found.append(Row(f"gain: {what}", must, len(of), ratio, passed=ratio >= least))
        else:
            found.append(Row(f"gain: {what}", must))
    clean = [r for r in measured if r["part"] == "null"]
    row = Row("gain: nulls", "≥ −0.2 %")
    if clean:
        lost = float(
            np.sum([r["gained"] for r in clean]) / np.sum([abs(r["held_out_nll"]) for r in clean])
        )
        row = Row(row.what, row.must, len(clean), lost, passed=lost >= -0.002)
    return [*found, row]


def coverage(records: Sequence[Record]) -> list[Row]:
    inside: dict[str, list[bool]] = {}
    for r in large(records):
        for key, hit in r["covered"].items():
            inside.setdefault(key, []).append(hit)
    pooled = [hit for hits in inside.values() for hit in hits]
    each = [share(f"±2 σ: {key}", "", hits, lambda _: True) for key, hits in sorted(inside.items())]
    out = [
        row.what.removeprefix("±2 σ: ")
        for row in each
        if row.low is not None and row.high is not None and (row.low > 0.98 or row.high < 0.92)
    ]
    strays = Row("±2 σ: effects outside 92–98 %", "none")
    if each:
        strays = Row(strays.what, strays.must, len(each), float(len(out)), passed=not out)
    of_two = [hit for r in records if r["part"] == "two" for hit in r["covered"].values()]
    return [
        share("±2 σ coverage, pooled", "94–97 %", pooled, lambda p: 0.94 <= p <= 0.97),
        strays,
        *each,
        share("±2 σ: sizes of two effects", "", of_two, lambda _: True),
    ]
