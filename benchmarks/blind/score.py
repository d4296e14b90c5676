"""One case: `clutchest discover` on its files alone, then the answer opened and both compared."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from blind.cases import HELD_OUT, LOG, VEHICLE, drive_of, outsider_of, write
from blind.drives import VEHICLE as TRUCK
from blind.gain import on_held_out
from blind.plan import Case, gains
from blind.sealed import unseal
from clutchest.reading.tables import write_signals
from clutchest.simulated import Effects, simulate
from clutchest.vehicle import dump_vehicle, load_vehicle

MEASURED = Path(__file__).parent / "measured.py"
LONGEST = 1200.0  # s that a discovery may take
APART = 2.0  # d′; effects nearer to each other than this cannot be told apart
SEEN = 3.5  # d′; an effect that does not reach it at its largest plausible size is unexcited

Record = dict[str, Any]


def score(
    case: Case,
    out: Path,
    *,
    measured: bool,
    followed: bool = True,
    alone: bool = False,
    known: Record | None = None,
) -> Record:
    """The case's record.  ``measured``: hold-out gains too, which compiles a model per extension;
    ``followed``: the manoeuvre that an ambiguous verdict proposes is driven; ``alone``: no drive is
    held out, so that none can take a finding back;
    ``known``: the answer, where the oracle has been asked before."""
    folder, sealed = out / "work" / case.blind_name, out / "answers" / f"{case.blind_name}.sealed"
    if known is None and sealed.exists():
        known = unseal(sealed)
    write(case, folder, sealed, known)
    if alone:
        (folder / HELD_OUT).unlink()
    found = discovered([folder / LOG], folder, folder / "found")
    answer = unseal(sealed)
    record = {**asdict(case), "name": case.name, **judged(answer, found)}
    record["followed_up"] = _followed_up(case, answer, found, folder) if followed else None
    if measured:
        extended = folder / "found" / "extended.toml"
        record |= on_held_out(drive_of(case, answer), answer, extended)
    shutil.rmtree(folder)
    return record


def discovered(logs: Sequence[Path], folder: Path, out: Path) -> Record:
    """What `clutchest discover` says of ``logs``: discovery.json, with ``seconds`` of the processor
    and ``MiB`` it took; verdict ``failed`` with ``why`` where it says nothing."""
    out.mkdir(parents=True, exist_ok=True)
    took, words, written = out / "took.json", out / "stderr.txt", out / "discovery.json"
    command = [
        sys.executable,
        "-m",
        "clutchest",
        "discover",
        *map(str, logs),
        "--json",
        "--vehicle",
        str(folder / VEHICLE),
        "--out",
        str(out),
    ]
    if (folder / HELD_OUT).exists():
        command += ["--holdout", str(folder / HELD_OUT)]
    with words.open("w") as errors:
        process = subprocess.Popen(
            [sys.executable, str(MEASURED), str(took), *command],
            stdout=subprocess.DEVNULL,
            stderr=errors,
            start_new_session=True,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        )
        try:
            process.wait(LONGEST)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)  # the discovery, not only who measures it
            process.wait()
            return {"verdict": "failed", "why": "too slow", "seconds": LONGEST, "MiB": 0.0}
    cost = json.loads(took.read_text(encoding="ascii"))
    if (code := cost.pop("exit")) != 0 or not written.exists():
        lines = words.read_text().splitlines() or ["no word"]
        return {"verdict": "failed", "why": f"exit code {code}: {lines[-1]}", **cost}
    return {**json.loads(written.read_text(encoding="utf-8")), **cost}


def hour(out: Path, name: str, effects: Effects) -> Record:
    """A log of one hour, all that is measured of it being the cost."""
    folder, vehicle = out / "work" / "hour", load_vehicle(TRUCK)
    folder.mkdir(parents=True, exist_ok=True)
    write_signals(simulate(vehicle, "mixed", 1, effects, duration=3600.0), folder / LOG)
    dump_vehicle(vehicle, folder / VEHICLE)
    discovered([folder / LOG], folder, folder / "compiles")
    found = discovered([folder / LOG], folder, folder / "found")
    shutil.rmtree(folder)
    kept = {key: found.get(key) for key in ("verdict", "why", "seconds", "MiB")}
    return {"name": name, "part": "hour", **kept}


def judged(answer: Record, found: Record) -> Record:
    """The answer and what was found, side by side."""
    effects: Effects = answer["effects"]
    rivals: dict[str, float] = answer.get("rivals", {})
    causes = [cause["effect"] for cause in found.get("causes") or []]
    equation, drivers = located(found)
    return {
        "truth": list(effects) or ([answer["outsider"]["name"]] if answer["outsider"] else []),
        "reached": answer.get("d_prime", 0.0),
        "one_sided": answer.get("one_sided"),
        "nearest": min(rivals.values(), default=None),
        "alike": [name for name, distance in rivals.items() if distance < APART],
        "hidden_unexcited": _unexcited(answer),
        "verdict": found["verdict"],
        "why": found.get("why"),
        "causes": causes,
        "p_values": [cause.get("p_value") for cause in found.get("causes") or []],
        "refuted": refuted(found),
        "equation": equation,
        "drivers": drivers,
        "expected_where": answer.get("where"),
        "unexcited": found.get("unexcited"),
        "gain": found.get("gain"),
        "warnings": found.get("warnings"),
        "covered": covered(effects, found),
        "sizes": sizes(effects, found),
        "seconds": found["seconds"],
        "MiB": found["MiB"],
    }


def refuted(found: Record) -> list[str]:
    """Named causes whose form the data refute."""
    return [c["effect"] for c in found.get("causes") or [] if c.get("form") == "refuted"]


def located(found: Record) -> tuple[str | None, list[str] | None]:
    """The equation that is said to be wrong and what its error goes with."""
    where = found.get("where") or {}
    return where.get("equation"), where.get("drivers")


def covered(effects: Effects, found: Record) -> dict[str, bool]:
    """``effect.gain`` → whether the truth lies within two standard deviations of what was found,
    for every gain of a named true effect, shapes left out."""
    return {
        gain: abs(value - true) <= 2.0 * std
        for gain, (true, value, std) in sizes(effects, found).items()
    }


def sizes(effects: Effects, found: Record) -> dict[str, tuple[float, float, float]]:
    """The same numbers themselves: the truth, what was found and its standard deviation."""
    if found["verdict"] != "named":
        return {}
    numbers, known = {}, gains()
    for cause in found["causes"]:
        for key, true in effects.get(cause["effect"], {}).items():
            told, gain = cause["parameters"].get(key), f"{cause['effect']}.{key}"
            if gain in known and told and told.get("std") is not None:
                numbers[gain] = true, told["value"], told["std"]
    return numbers


def _unexcited(answer: Record) -> bool:
    """Whether what is hidden could not be seen in this drive, however large."""
    if len(answer["effects"]) != 1:
        return False
    return all(
        answer["excited"][answer["case"]["cause"]] < limit
        for limit in (SEEN, answer["case"]["d_prime"])
    )


def _followed_up(case: Case, answer: Record, found: Record, folder: Path) -> Record | None:
    """What comes out after the manoeuvre that an ambiguous verdict proposes."""
    experiment = found.get("experiment") or {}
    scenario = experiment.get("scenario")
    if found["verdict"] != "ambiguous" or not scenario or case.part != "effect":
        return None
    drive = drive_of(case, answer)
    extra = folder / "more.parquet"
    write_signals(drive.signals(answer["effects"], outsider_of(answer), scenario=scenario), extra)
    again = discovered([folder / LOG, extra], folder, folder / "again")
    named = [cause["effect"] for cause in again.get("causes") or []]
    right = again["verdict"] == "named" and named == list(answer["effects"])
    return {"scenario": scenario, "verdict": again["verdict"], "causes": named, "right": right}
