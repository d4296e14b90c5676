"""How far the imperfections of the data may grow before a row of a reproduction fails.

    python benchmarks/margins.py [--rows D2 D7] [--write]

Prints one line per row and imperfection of `clutchest reproduce me12`; with --write they are kept
in the package, where the table shows them as long as the vehicle's numbers and the imperfections
are the same.  Takes about half an hour: every size tried is a run of the whole row.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path

from clutchest.reproduce import me12
from clutchest.reproduce.claim import Margin, Verdict, margin


def margins_of(claim: me12.Claim) -> dict[str, Margin]:
    """Imperfection → how far it may grow."""
    found = {}
    for name in claim.strained_by:
        setup = me12.setup()

        def judge(size: float, name: str = name, setup: me12.Setup = setup) -> Verdict:
            setup.made.clear()
            return claim.judge(setup.wrong(**{name: size}))

        found[name] = margin(judge, getattr(setup.imperfections, name))
        print(f"{claim.name:4} {name:16} {found[name]}", flush=True)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", nargs="+", default=[c.name for c in me12.CLAIMS])
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    path = Path(me12.__file__).with_name(me12.MARGINS)
    kept = json.loads(path.read_text()) if path.is_file() else {"rows": {}}
    numbers = me12.numbers(me12.setup())
    rows = kept["rows"] if kept.get("numbers") == numbers else {}
    for claim in me12.CLAIMS:
        if claim.name in arguments.rows and claim.strained_by:
            rows[claim.name] = {name: asdict(m) for name, m in margins_of(claim).items()}
            if arguments.write:
                path.write_text(json.dumps({"numbers": numbers, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
