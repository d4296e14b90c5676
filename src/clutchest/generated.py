"""Compiled modules that are put together at run time, each named by a hash of its text.

numba caches only what lives in a file, and keeps an old answer when a function in *another* file
changes.  So everything that the compiled code depends on stands in one file whose name is a hash
of its text, of the versions of numba, CasADi and clutchest, and of the CPU.
"""

from __future__ import annotations

import hashlib
import importlib.util
import sys
from collections.abc import Sequence
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

from clutchest import __version__
from clutchest.cache import cache_folder, kept
from clutchest.native.source import GENERATED

MARK = "# --- the generated module goes on from here ---\n"


def text_of(path: Path) -> str:
    """What a file contributes to a generated module: what stands behind the mark."""
    return path.read_text(encoding="utf-8").split(MARK)[1]


def named(parts: Sequence[str]) -> tuple[str, str]:
    """(hash, source) of these parts of a module."""
    import llvmlite.binding

    text = "\n\n".join(parts)
    platform = [version(name) for name in ("numba", "casadi")]
    platform += [__version__, llvmlite.binding.get_host_cpu_name(), sys.version]
    digest = hashlib.sha256("\n".join([*platform, text]).encode()).hexdigest()[:16]
    return digest, text


@lru_cache(maxsize=32)
def load(digest: str, text: str, kind: str = "model") -> ModuleType:
    """The generated module, of a ``kind`` that names its file; written at first use, compiled at
    first call, cached from then on."""
    path = kept(cache_folder(), f"{kind}_{digest}.py", text)
    name = GENERATED + digest
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
