"""The table of the differential's suite: the lines and limits of the truck's, of every case as it
came out, and below them each case."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from blind.differential_outsiders import OUTSIDERS
from blind.first_run import effects, placed
from blind.row import Record, Row, false_findings, share

WITHIN = 2.0  # standard deviations of a size


def rows(records: Sequence[Record]) -> list[Row]:
    """Every line of the table; runs that gave no answer are counted in a line of their own."""
    judged = [common(r) for r in records if r["verdict"] != "error"]
    healthy = [r for r in judged if r["part"] == "null"]
    seconds = [r["seconds"] for r in judged]
    of = {scenario: [r for r in healthy if r["scenario"] == scenario] for scenario in _in(healthy)}
    return [
        *(false_findings(f"false findings, {name}", some) for name, some in of.items()),
        false_findings("false findings, all scenarios", healthy),
        *effects(judged),
        share(
            "sizes of what is named: within 2 σ",
            "94 to 97 %",
            [abs(z) <= WITHIN for r in judged for z in _off(r)],
            lambda p: 0.94 <= p <= 0.97,
        ),
        *placed([r for r in judged if r["part"] == "outsider"], "all outsiders"),
        share("runs without an answer", "none", [r["verdict"] == "error" for r in records], _none),
        *([_median(seconds)] if seconds else []),
    ]


def common(record: Record) -> dict[str, Any]:
    """The record with what those of the truck's suite have."""
    truth, where = list(record["effects"]), record.get("where") or {"equation": "", "drivers": []}
    outsider = OUTSIDERS.get(record.get("outsider", ""))
    part = "outsider" if outsider else ("null", "effect", "two")[len(truth)]
    said = where["drivers"]
    return {
        **record,
        "part": part,
        "truth": truth,
        "causes": sorted({name for names in record.get("sets", ()) for name in names}),
        "refuted": record.get("refuted", []),
        "equation": where["equation"],
        "drivers": said,
        "expected_where": {
            "equation": outsider.equations[0] if outsider else "",
            "equations": outsider.equations if outsider else (),
            "drivers": outsider.drivers if outsider else (),
        },
    }


def lines(records: Sequence[Record]) -> list[str]:
    """What was hidden in each case, and what was said of it."""
    return [_line(common(r)) for r in records if r["effects"] or r.get("outsider")]


def _line(record: Record) -> str:
    said = " or ".join("+".join(names) for names in record.get("sets", ()))
    if not said and record["equation"]:
        said = f"{record['equation']} over {', '.join(record['drivers'][:2])}"
    if name := record.get("outsider"):
        hidden = f"{name} {record['size']:.3g} {OUTSIDERS[name].unit}"
    else:
        hidden = " and ".join(map(_size, *_sizes(record)))
    answer = f"{record['verdict']}: {said}" if said else record["verdict"]
    refuted = f" (form refuted: {', '.join(record['refuted'])})" if record["refuted"] else ""
    return f"{hidden}, {record['scenario']} {record['seed']}: {answer}{refuted}"


def _off(record: Record) -> list[float]:
    """By how many standard deviations each size is off that was hidden and alone is named."""
    if record["verdict"] != "named":
        return []
    return [
        (value - size) / std
        for name, size, (value, std) in zip(*_sizes(record), strict=True)
        if name in record["causes"] and np.isfinite(value) and std > 0.0
    ]


def _sizes(record: Record) -> tuple[list[str], list[float], list[tuple[float, float]]]:
    """Of every hidden effect its name, its size, and what was found with its standard deviation."""
    names, hidden, found = [], [], []
    for name, gains in record["effects"].items():
        for key, size in gains.items():
            value, std = record.get("sizes", {}).get(f"{name}.{key}", (np.nan, np.nan))
            names.append(name)
            hidden.append(size)
            found.append((value, std))
    return names, hidden, found


def _size(name: str, size: float, found: tuple[float, float]) -> str:
    value, std = found
    return f"{name} {size:.3g}" + (f" ({value:.3g} ± {std:.2g})" if np.isfinite(value) else "")


def _in(records: Sequence[Record]) -> list[str]:
    return sorted({record["scenario"] for record in records})


def _median(seconds: Sequence[float]) -> Row:
    count, middle = len(seconds), float(np.median(seconds))
    return Row("processor time of one discovery, s", "", count, middle, min(seconds), max(seconds))


def _none(share: float) -> bool:
    return share == 0.0
