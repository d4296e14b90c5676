"""Effects of the library as a user's own, to be simulated beside the generator's."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import numpy as np

from clutchest.signals import Floats, Signals


def twin(folder: Path, effects: ModuleType, name: str) -> Path:
    """The library's effect as a user's own, under another name."""
    assert effects.__file__
    source = (Path(effects.__file__).parent / f"{name}.py").read_text(encoding="utf-8")
    path = folder / "own.py"
    path.write_text(source.replace(f'name = "{name}"', f'name = "own_{name}"'), encoding="utf-8")
    return path


def shown(drive: Signals, name: str, readings: Sequence[str]) -> Floats:
    """What a sensor reads, or else a state of the truth."""
    assert drive.truth
    return drive[name].value if name in readings else drive.truth.columns[name]


def assert_alike(without: Floats, wanted: Floats, made: Floats, missing: float, least: float):
    """That an effect changes something, and its twin the same but for the share ``missing``."""
    change = np.sqrt(np.nanmean((wanted - without) ** 2))
    assert change > 0.0
    assert np.sqrt(np.nanmean((made - wanted) ** 2)) <= missing * change + least
