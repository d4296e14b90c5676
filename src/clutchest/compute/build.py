"""Two generated modules per model, of its filters and of its fits: lowered functions and kernel
text."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

from clutchest.cache import cache_folder
from clutchest.compute.functions import filter_text, fit_text, forward_text
from clutchest.compute.kept_text import Thetas, kept_text
from clutchest.generated import named, text_of
from clutchest.models.model import Model

_HEADER = '''"""Generated; do not edit."""
from math import acos, acosh, asin, asinh, atan, atanh, ceil, cos, cosh, erf, exp, expm1, inf
from math import log, log1p, nan, pi, sin, sinh, sqrt, tan, tanh
from typing import Any, NamedTuple

import numpy as np
from clutchest.native import compiled

'''
_FILTERS = ("records.py", "update.py", "kernel.py", "smoother.py")
_FITS = ("records.py", "update.py", "sensitivities.py")
_TextOf = Callable[[Model, Thetas], str]


_lowered: deque[tuple[_TextOf, Model, Thetas, str]] = deque(maxlen=16)


def generate(model: Model, thetas: Sequence[tuple[str, str]]) -> tuple[str, str]:
    """(hash, source) of the module of this model's filters, with signatures of ``thetas``."""
    return _generated(filter_text, model, tuple(thetas), _FILTERS)


def generate_for_fits(model: Model, thetas: Sequence[tuple[str, str]]) -> tuple[str, str]:
    """(hash, source) of the module of this model's fits: how innovations answer to ``thetas``."""
    return _generated(fit_text, model, tuple(thetas), _FITS)


def _generated(
    text_of: _TextOf, model: Model, thetas: Thetas, kernels: Sequence[str]
) -> tuple[str, str]:
    # a function is compiled when it is first called: who does not draw or smooth does not wait
    parts = [_HEADER, _text_of("choices.py"), _lowered_once(text_of, model, thetas)]
    return named([*parts, *map(_text_of, kernels)])


def _lowered_once(text_of: _TextOf, model: Model, thetas: Thetas) -> str:
    """The lowered functions; drives that follow each other need the same."""
    for kind, known, taken, text in tuple(_lowered):  # another thread may add to it meanwhile
        if kind is text_of and taken == thetas and known == model:
            return text
    text = kept_text(text_of, model, thetas)
    _lowered.append((text_of, model, thetas, text))
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
