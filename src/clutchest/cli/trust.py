"""``trust``: vehicle files whose Python may run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from clutchest.cli.options import AsJson
from clutchest.cli.parameters import Argument
from clutchest.cli.terminal import print_json


def trust(
    files: Annotated[
        list[Path],
        Argument(metavar="FILE", help="Vehicle files that name Python files."),
    ],
    as_json: AsJson = False,
) -> None:
    """Let vehicle files run the Python files that they name.

    Read these files first: they can do all that you can.  What is trusted is the present content of
    the vehicle file and of all that it names; whoever changes one of them has to be trusted anew.
    They are checked for their syntax now, and run with the vehicle's first use.  Shipped vehicles,
    and those that discover and identify write here, need none of this.

    \b
    Example:
      clutchest trust servo.toml
    """
    from clutchest.vehicle.trust import trust as trusted

    done = [(path, trusted(path)) for path in files]
    if as_json:
        print_json(
            [
                {"file": str(path), "runs": list(map(str, named.code)), "sha256": named.content}
                for path, named in done
            ]
        )
        return
    for path, named in done:
        runs = ", ".join(each.name for each in named.code) or "nothing: it names no Python file"
        print(f"Trusted: {path}, which runs {runs}")
