"""One generated module per model: lowered functions and kernel text."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path

from clutchest.cache import cache_folder
from clutchest.compute.functions import forward_text
from clutchest.compute.kept_text import kept_text
from clutchest.generated import named, text_of
from clutchest.models.model import Model

_HEADER = '''"""Generated; do not edit."""
from math import ceil, cos, exp, expm1, inf, log, nan, pi, sin, sqrt, tanh
from typing import Any, NamedTuple

import numpy as np
from clutchest.native import compiled

'''
_KERNELS = ("records.py", "update.py", "kernel.py", "smoother.py", "sensitivities.py")


_lowered: deque[tuple[Model, tuple[tuple[str, str], ...], str]] = deque(maxlen=8)


def generate(model: Model, thetas: Sequence[tuple[str, str]]) -> tuple[str, str]:
    """(hash, source) of the module for this model, with signatures of ``thetas``."""
    # a function is compiled when it is first called: who does not draw or smooth does not wait
    parts = [_HEADER, _text_of("choices.py"), _lowered_once(model, tuple(thetas))]
    return named([*parts, *map(_text_of, _KERNELS)])


def _lowered_once(model: Model, thetas: tuple[tuple[str, str], ...]) -> str:
    """The lowered functions; drives that follow each other need the same."""
    for known, taken, text in tuple(_lowered):  # another thread may add to it meanwhile
        if taken == thetas and known == model:
            return text
    text = kept_text(model, thetas)
    _lowered.append((model, thetas, text))
    return text


def generate_forward(model: Model, watched: Sequence[str]) -> tuple[str, str]:
    """(hash, source) of the module that runs this model forward and writes out quantities."""
    return named(
        [_HEADER, _text_of("choices.py"), forward_text(model, watched), _text_of("marching.py")]
    )


def _text_of(file: str) -> str:
    """What a file of this folder contributes to the generated module."""
    return text_of(Path(__file__).parent / file)


def is_compiled(digest: str) -> bool:
    """Whether this machine has run the module before, so that it starts at once."""
    return (cache_folder() / f"model_{digest}.py").exists()
