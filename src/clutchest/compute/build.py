"""One generated module per model: lowered functions and kernel text, named by a hash of both.

numba caches only what lives in a file, and keeps an old answer when a function in *another* file
changes.  So everything that the compiled code depends on stands in one file whose name is a hash
of its text, of the versions of numba, CasADi and clutchest, and of the CPU.
"""

from __future__ import annotations

import hashlib
import importlib.util
import sys
import tempfile
from collections import deque
from collections.abc import Sequence
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

from clutchest import __version__
from clutchest.cache import cache_folder, kept
from clutchest.compute.lower import forward_text, module_text
from clutchest.models.model import Model

_HEADER = '''"""Generated; do not edit."""
from math import ceil, cos, exp, expm1, inf, log, nan, pi, sin, sqrt, tanh
from typing import Any, NamedTuple

import numpy as np
from numba import njit

'''
MARK = "# --- the generated module goes on from here ---\n"


_lowered: deque[tuple[Model, tuple[tuple[str, str], ...], str]] = deque(maxlen=8)


def generate(model: Model, thetas: Sequence[tuple[str, str]]) -> tuple[str, str]:
    """(hash, source) of the module for this model, with signatures of ``thetas``."""
    # numba compiles a function when it is first called: who does not draw or smooth does not wait
    parts = [_HEADER, _text_of("choices.py"), _lowered_once(model, tuple(thetas))]
    parts += [
        _text_of(file) for file in ("records.py", "kernel.py", "smoother.py", "sensitivities.py")
    ]
    return named(parts)


def _lowered_once(model: Model, thetas: tuple[tuple[str, str], ...]) -> str:
    """:func:`module_text`; drives that follow each other need the same."""
    for known, taken, text in _lowered:
        if taken == thetas and known == model:
            return text
    text = module_text(model, thetas)
    _lowered.append((model, thetas, text))
    return text


def generate_forward(model: Model, watched: Sequence[str]) -> tuple[str, str]:
    """(hash, source) of the module that runs this model forward and writes out quantities."""
    return named(
        [_HEADER, _text_of("choices.py"), forward_text(model, watched), _text_of("marching.py")]
    )


def named(parts: Sequence[str]) -> tuple[str, str]:
    """(hash, source) of these parts of a module."""
    import llvmlite.binding

    text = "\n\n".join(parts)
    platform = [version(name) for name in ("numba", "casadi")]
    platform += [__version__, llvmlite.binding.get_host_cpu_name(), sys.version]
    digest = hashlib.sha256("\n".join([*platform, text]).encode()).hexdigest()[:16]
    return digest, text


def _text_of(file: str) -> str:
    """What a file of this folder contributes to the generated module."""
    return (Path(__file__).parent / file).read_text(encoding="utf-8").split(MARK)[1]


@lru_cache(maxsize=32)
def load(digest: str, text: str) -> ModuleType:
    """The generated module; written at first use, compiled at first call, cached from then on."""
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path = kept(folder, f"model_{digest}.py", text)
    except OSError:  # a read-only home: compile anew in each process
        path = kept(Path(tempfile.mkdtemp(prefix="clutchest-")), f"model_{digest}.py", text)
    name = f"clutchest_generated_{digest}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def is_compiled(digest: str) -> bool:
    """Whether this machine has run the module before, so that it starts at once."""
    folder = cache_folder() / "__pycache__"
    return any(
        any(folder.glob(f"model_{digest}.{first}-*.nbi"))
        for first in ("run", "filter_sensitivities")
    )
