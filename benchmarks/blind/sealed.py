"""Answers that nobody reads by accident, and that cannot change unnoticed."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import zlib
from pathlib import Path
from typing import Any

KNOWN = Path(__file__).parent / "answers.sealed"  # what the oracle has been asked so far


def seal(answer: dict[str, Any], path: Path) -> None:
    """Write ``answer`` as one line of compressed text and one of its hash."""
    text = json.dumps(answer, sort_keys=True).encode()
    body = base64.b64encode(zlib.compress(text)).decode()
    whole = path.with_name(f"{path.name}.{os.getpid()}")  # another shard may be reading
    whole.write_text(f"{body}\n{hashlib.sha256(text).hexdigest()}\n", encoding="ascii")
    whole.replace(path)


def unseal(path: Path) -> dict[str, Any]:
    """What was sealed.  Raises ValueError where the file is not as it was written."""
    try:
        body, digest = path.read_text(encoding="ascii").split()
        text = zlib.decompress(base64.b64decode(body, validate=True))
    except (ValueError, zlib.error) as problem:
        raise ValueError(f"{path}: not a sealed answer: {problem}") from None
    if hashlib.sha256(text).hexdigest() != digest:
        raise ValueError(f"{path}: the sealed answer has been changed")
    answer: dict[str, Any] = json.loads(text)
    return answer
