"""Results that a long run keeps, one line of JSON each, so that it goes on where it stopped."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def kept(path: Path) -> list[dict[str, Any]]:
    """The records in a file, none where there is no file yet."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def keep(path: Path, record: Mapping[str, Any]) -> None:
    """Add one to them."""
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(record) + "\n")
