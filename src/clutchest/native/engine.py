"""LLVM: from the text of a module to machine code, and to the address of its ``entry``.

Machine code is the same for the same text, processor and LLVM, so that it can be kept on disk.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import os
import sys
from functools import lru_cache
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from clutchest.native.arithmetic import OF_C

OLDEST = 20  # of LLVM, whose text is written here
LEVEL = 2
INLINED = 75  # cost up to which LLVM inlines by itself: of more, a reader takes twice as long
OBJECT_HEAD = object.__basicsize__  # bytes before what is an object's own
_OF_LLVM = ("exp", "log", "pow", "sin", "cos", "floor", "ceil", "memset", "memcpy")
_NEEDED = (*_OF_LLVM, *OF_C)


def works() -> bool:
    """Whether this platform can be compiled for: 64 bits, little endian, an LLVM that is known.

    ``CLUTCHEST_COMPILER=numba`` has numba do it.
    """
    if os.environ.get("CLUTCHEST_COMPILER") == "numba":
        return False
    known = llvm.llvm_version_info[0] >= OLDEST and _arrays_are_known()
    return known and sys.byteorder == "little" and sys.maxsize > 2**32


def _arrays_are_known() -> bool:
    """Whether numpy's objects lie in memory as is believed: see ``llvm_module.slots_of``."""
    array = np.zeros((3, 5, 7))[1:, ::2]
    if sys.implementation.name != "cpython":
        return False
    data, _, sizes, steps = (ctypes.c_uint64 * 4).from_address(id(array) + OBJECT_HEAD)
    if data != array.__array_interface__["data"][0]:
        return False
    shape, strides = ((ctypes.c_int64 * 3).from_address(at) for at in (sizes, steps))
    return (tuple(shape), tuple(strides)) == (array.shape, array.strides)


def platform() -> str:
    """What machine code depends on, beside the text."""
    features = llvm.get_host_cpu_features().flatten()
    version = ".".join(map(str, llvm.llvm_version_info))
    processor = f"{llvm.get_process_triple()} {llvm.get_host_cpu_name()} {features}"
    return f"{processor} {version} {LEVEL} {OBJECT_HEAD}"


@lru_cache(maxsize=1)
def _target() -> Any:
    """The target machine.  Named where the machine's own library of functions is not loaded."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    library = ctypes.util.find_library("m") or ctypes.util.find_library("ucrtbase")
    for name in _NEEDED:
        if library and llvm.address_of_symbol(name) is None:
            function = getattr(ctypes.CDLL(library), name, None)
            if function is not None:
                llvm.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=LEVEL,
        reloc="static" if target.name.startswith("x86") else "default",
        codemodel="jitdefault",
        jit=True,
    )


def machine_code(text: str) -> bytes:
    """The object file of a module."""
    machine = _target()
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    tuning = llvm.create_pipeline_tuning_options(speed_level=LEVEL)
    tuning.loop_vectorization = True
    tuning.slp_vectorization = True
    tuning.inlining_threshold = INLINED
    builder = llvm.create_pass_builder(machine, tuning)
    builder.getModulePassManager().run(module, builder)
    code: bytes = machine.emit_object(module)
    return code


_engines: list[Any] = []  # code lives as long as they do


def address(code: bytes) -> int:
    """Where the ``entry`` of an object file begins, in memory."""
    machine = _target()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _engines.append(engine)
    found: int = engine.get_function_address("entry")
    return found
