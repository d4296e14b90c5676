"""Wrong starts: what is left of them once the observability analysis calls excitation enough."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from own_model import Plan
from statistic import line, percentiles, shown

from clutchest.estimate.whole_log import FilterOptions, copied, run
from drawn import draw

LEFT = 0.05  # share of a start's error that may be left


def starts(task: tuple[str, int, int, float]) -> dict[str, Any]:
    """``count`` drives of one plan whose truth starts ``wrong`` beside the prior, signs drawn.

    Per state: ``enough`` (drives) s, from when on the filter's own gains leave less than ``LEFT``
    of a start's error (NaN: never); ``engagements`` (drives) by then; ``error`` and ``std`` and
    ``bound`` (drives) there, root mean squares over the rest of the drive; ``inside`` (drives),
    share of that rest within 3 σ.  ``course``: times and |error| of the first drives.
    """
    name, seed, count, duration = task
    plan = Plan.of(name, seed, duration)
    model, grid = plan.compiled.model, plan.line.grid
    wrong = plan.clutch.wrong
    found: dict[str, Any] = {
        s: {k: [] for k in ("enough", "engagements", "error", "std", "bound", "inside", "course")}
        for s in wrong
    }
    found["time"], found["wrong"] = plan.time, wrong
    for number in range(count):
        random = np.random.default_rng([seed, number])
        truth = plan.prior.x + np.sqrt(np.diag(plan.prior.P)) * random.standard_normal(
            len(plan.prior.x)
        )
        for state, size in wrong.items():
            i = model.state(state)
            truth[i] = plan.prior.x[i] + size * random.choice([-1.0, 1.0])
        drawn = draw(
            plan.compiled, plan.line, plan.prior, 10_000 * seed + number, truth, plan.clutch.driver
        )
        filtered = run(plan.compiled, drawn.timeline, plan.prior, FilterOptions(keep=True))
        for state, size in wrong.items():
            i = model.state(state)
            moved = copied(plan.prior)
            moved.x[i] += size / 100  # the response of the estimate to its start, gains held
            other = run(plan.compiled, drawn.timeline, moved, FilterOptions(gains=filtered.gains))
            left = np.abs(other.x[grid, i] - filtered.x[grid, i]) / (size / 100)
            over = np.flatnonzero(left > LEFT)
            first = over[-1] + 1 if len(over) else 0
            rest = slice(min(first, len(left) - 1), None)
            error = (filtered.x[grid, i] - drawn.x[grid, i])[rest]
            std = np.sqrt(filtered.P[grid, i, i])[rest]
            row = found[state]
            row["enough"].append(plan.time[first] if first < len(left) else np.nan)
            row["engagements"].append(float(np.sum(plan.engagements < plan.time[rest][0])))
            row["error"].append(np.mean(error**2))
            row["std"].append(np.mean(std**2))
            row["bound"].append(np.mean(drawn.bound[grid, i][rest]))
            row["inside"].append(np.mean(np.abs(error) < 3 * std))
            if number < 3:
                row["course"].append(np.abs(filtered.x[grid, i] - drawn.x[grid, i]))
    return found


def table(results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Per state: when excitation is enough, and what is left of the error from then on."""
    out = {}
    for state, size in results[0]["wrong"].items():
        rows = {
            k: np.concatenate([r[state][k] for r in results])
            for k in ("enough", "engagements", "error", "std", "bound", "inside")
        }
        ever = np.isfinite(rows["enough"])
        if not ever.any():
            out[state] = {"wrong_by": size, "drives": len(ever), "recovered": 0, "passed": False}
            continue
        kept = {k: v[ever] for k, v in rows.items()}
        error, bound = np.sqrt(kept["error"].mean()), np.sqrt(kept["bound"].mean())
        allowed = max(LEFT * size, 2 * bound)
        out[state] = {
            "wrong_by": size,
            "drives": len(ever),
            "recovered": int(ever.sum()),
            "enough_s": percentiles(kept["enough"]),
            "engagements": percentiles(kept["engagements"]),
            "error": float(error),
            "bound": float(bound),
            "allowed": float(allowed),
            "inside_3_std": float(kept["inside"].mean()),
            "passed": bool(error <= allowed),
        }
    return out


def show(found: dict[str, Any]) -> str:
    """The table as text."""
    lines = [
        "wrong starts, all at once: error from when on the gains leave less than 5 % of the start",
        line(
            "",
            ("wrong by", "enough after [s]", "engagements", "error", "bound", "allowed", "in 3 σ"),
            18,
        ),
    ]
    for state, c in found.items():
        if not c["recovered"]:
            lines.append(line(state, [f"{c['wrong_by']:.3g}"], 18) + "   never in these drives")
            continue
        numbers = (f"{c[key]:.3g}" for key in ("error", "bound", "allowed"))
        cells = (
            f"{c['wrong_by']:.3g}",
            shown(c["enough_s"], ".0f"),
            shown(c["engagements"], ".0f"),
            *numbers,
            f"{c['inside_3_std']:.4f}",
        )
        verdict = f"  {c['recovered']} of {c['drives']}{'' if c['passed'] else '  NOT MET'}"
        lines.append(line(state, cells, 18) + verdict)
    return "\n".join(lines)
