"""A small compiler for numerical Python: syntax tree → LLVM → machine code, kept on disk.

It translates what this toolkit's loops over samples are made of, and nothing else: see
:func:`compiled`.  numba translates far more, and takes twenty times as long over it; it takes over
on platforms that this compiler does not know, and is what it is compared with in the tests.
"""

from typing import Any

from clutchest.native import dispatch, reference
from clutchest.native.engine import works

compiled: Any = dispatch.compiled if works() else reference.compiled
