"""What an extension gains on data that were not used to find it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchest.discovery.drivers import drivers, hats
from clutchest.discovery.leftover import Curve
from clutchest.discovery.probes import PREFIX
from clutchest.discovery.result import Gain
from clutchest.discovery.search import Hypothesis, Search
from clutchest.discovery.torque import torques
from clutchest.identify.linearised import Problem
from clutchest.identify.maximum import Fitter, Look
from clutchest.signals import Floats

BLOCK = 20.0  # s; what lies closer together is not independent
RESAMPLED = 1000


def on_another(search: Search, best: Hypothesis, other: Problem) -> Gain:
    """Of a hypothesis fitted to one problem, on the drives of another.

    Numbers of the vehicle are those found; what a drive starts from is fitted anew to each, with
    and without the causes.
    """
    fitter = Fitter(other)
    looks: list[Look] = []
    for hypothesis in (best, search.null):
        theta = np.zeros(len(other.thetas))
        theta[: other.shared] = hypothesis.look.theta[: search.problem.shared]
        late = len(search.problem.timing)
        if late:
            theta[-late:] = hypothesis.look.theta[-late:]
        starts = np.array([k for k, t in enumerate(other.thetas) if t.drive >= 0])
        if not looks:  # noise as what was found leaves it
            first = fitter.most_probable(starts, theta, hypothesis.look.shapes)
            fitter.focus([fitter.taught(first).psi])
        looks.append(fitter.most_probable(starts, theta, hypothesis.look.shapes))
    after, before = looks
    assert fitter.span is not None
    return gain(other, before, after, *_squares(before.r, after.r, fitter.span))


def _squares(before: Floats, after: Floats, span: Floats) -> tuple[Floats, Floats]:
    """Squares (K) of innovations before and after; what lies outside of the span (K, q) is noise
    of the inputs and the same for both."""
    inside = [span @ (span.T @ r) for r in (before, after)]
    noise = (after - inside[1]) ** 2
    return inside[0] ** 2 + noise, inside[1] ** 2 + noise


def gain(problem: Problem, before: Look, after: Look, old: Floats, new: Floats) -> Gain:
    """From squares of white innovations ``old`` and ``new`` (K)."""
    difference = 0.5 * (old - new)
    blocks = np.concatenate([
        i * 10**6 + np.floor(d.t / BLOCK).astype(int) for i, d in enumerate(problem.drives)
    ])  # fmt: skip
    _, of = np.unique(blocks, return_inverse=True)
    sums = np.bincount(of, difference)
    rng = np.random.default_rng(0)
    drawn = sums[rng.integers(len(sums), size=(RESAMPLED, len(sums)))].sum(axis=1)
    low, high = np.quantile(drawn, [0.025, 0.975])
    raw_before, raw_after = (np.concatenate([rows.r for rows in look.raw])
                             for look in (before, after))  # fmt: skip
    errors = [_torque_error(problem, look) for look in (before, after)]
    return Gain(
        rmse_before=float(np.sqrt(np.mean(raw_before**2))),
        rmse_after=float(np.sqrt(np.mean(raw_after**2))),
        nll_before=float(0.5 * old.sum()),
        nll_after=float(0.5 * new.sum()),
        simulation_rmse_before=errors[0],
        simulation_rmse_after=errors[1],
        ci95=(float(low), float(high)),
    )


def _torque_error(problem: Problem, look: Look) -> float:
    """Root mean square of measured less simulated clutch torque, Nm."""
    joined = np.concatenate([(m - s) ** 2 for _, m, s in torques(problem, look)])
    return float(np.sqrt(np.mean(joined))) if len(joined) else 0.0


def of_curve(search: Search, curve: Curve, other: Problem) -> Gain:
    """Of a curve in place of a cause, on the drives of another problem, to first order: the curve
    as it was found, what each drive starts from fitted anew."""
    fitter = Fitter(other)
    theta = np.zeros(len(other.thetas))
    theta[: other.shared] = search.null.look.theta[: search.problem.shared]
    starts = np.array([k for k, t in enumerate(other.thetas) if t.drive >= 0])
    look = fitter.taught(fitter.most_probable(starts, theta, search.null.look.shapes))
    other.linearise(look.theta, look.shapes)
    probe = next(k for k, t in enumerate(other.thetas) if t.owner == PREFIX + curve.equation)
    bases = [hats(drivers(drive)[curve.driver], curve.at) for drive in other.drives]
    # nuisances stood in for the curve: what they give back when it comes
    free = search.problem.nuisances
    shift = np.zeros(len(theta))
    mine = [k for k in free if k < search.problem.shared]
    shift[mine] = -curve.given_back[np.searchsorted(free, mine)]
    change = fitter.modulated(look, [probe], bases) @ curve.coefficients + look.psi @ shift
    again = look.psi[:, starts]
    r = look.r + change
    r = r - again @ np.linalg.solve(again.T @ again + np.eye(len(starts)),
                                    again.T @ r + look.theta[starts])  # fmt: skip
    fitter.focus([look.psi, change])
    assert fitter.span is not None
    found = gain(other, look, look, *_squares(look.r, r, fitter.span))
    scale = float(np.sqrt(np.sum(r**2) / np.sum(look.r**2)))
    return replace(found, rmse_after=found.rmse_before * scale)
