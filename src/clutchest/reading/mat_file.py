"""MATLAB's files as plain values: versions 5 (6, 7) and 7.3.

A struct is a dictionary, a struct array or a cell array a list, text a string, numbers an array
without dimensions of one; anything else, such as an object, is left out.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from clutchest import budgets
from clutchest.errors import ClutchestError
from clutchest.extras import required
from clutchest.reading.table_budget import check_cells

MARK_5, MARK_7_3 = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"
DEEPEST = 12  # structs within structs
MOST_PARTS = 100_000
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5
_NUMBERS, _OTHERS = range(6, 16), (16, 17)  # those of all widths; functions and opaque objects
_COMPLEX = 0x800  # flag of an array
_KINDS = {*range(1, 8), 9, *range(12, 19)}  # of elements, that scipy looks up without a check


def contents(path: Path) -> dict[str, Any]:
    """Variable → value.  Raises ClutchestError for a file of another version, and beyond its
    budget."""
    with path.open("rb") as file:
        head = file.read(128)
    if head.startswith(MARK_7_3):
        return _of_hdf5(path)
    if head.startswith(MARK_5):
        return _of_version_5(path, head)
    raise ClutchestError(
        f"{path}: not a MAT file of version 5 to 7.3; expected one that MATLAB's save(…, '-v7') or "
        "'-v7.3' wrote"
    )


def _of_version_5(path: Path, head: bytes) -> dict[str, Any]:
    from scipy.io import loadmat

    order = "<" if head[126:128] == b"IM" else ">"
    content = path.read_bytes()
    _check(path, memoryview(content)[128:], order, 0, [budgets.UNPACKED_BYTES])
    with warnings.catch_warnings():  # of what is left out anyway
        warnings.simplefilter("ignore")
        found = loadmat(path, struct_as_record=False, squeeze_me=True, appendmat=False)
    return {n: v for n, v in ((n, _plain(v)) for n, v in found.items()) if v is not None}


def _check(path: Path, data: memoryview, order: str, depth: int, left: list[int]) -> list[int]:
    """The kinds of the elements in ``data``.

    Raises ClutchestError where arrays claim more elements than they have bytes, hold other kinds or
    numbers of them than scipy takes for granted, are nested too deeply, or inflate beyond the
    budget, of which so many bytes are ``left``.
    """
    at, kinds = 0, []
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        if kind >> 16:  # up to four bytes stand in the tag itself
            kind, size = kind & 0xFFFF, 0
        body = data[at + 8 : at + 8 + size]
        if depth and (kind not in _KINDS or len(body) < size):
            raise ClutchestError(f"{path}: damaged, an element of kind {kind}")
        if kind == _COMPRESSED and depth == 0:
            inflater = zlib.decompressobj()
            whole = inflater.decompress(body, max(left[0], 1))
            left[0] -= len(whole)
            if left[0] <= 0:
                raise ClutchestError(
                    f"{path}: holds more than {budgets.UNPACKED_BYTES >> 20} MiB compressed"
                )
            if _check(path, memoryview(whole), order, 1, left) != [_MATRIX]:
                raise ClutchestError(f"{path}: damaged, no array in a compressed element")
        elif kind == _MATRIX and size:
            _check_array(path, body, order, depth + 1, left)
        kinds.append(kind)
        at += 8 + (size if kind == _COMPRESSED else size + -size % 8)
    if depth > 1 and at != len(data):
        raise ClutchestError(f"{path}: damaged, elements do not fill their array")
    return kinds


def _check_array(path: Path, body: memoryview, order: str, depth: int, left: list[int]) -> None:
    flags, _, _, many = struct.unpack_from(f"{order}IIII", body, 8)
    shape = struct.unpack_from(f"{order}{many // 4}i", body, 24)
    what, elements = flags & 0xFF, 1
    for each in shape:
        elements *= max(each, 0)
    if depth > DEEPEST or (elements > len(body) and what != _SPARSE):
        raise ClutchestError(f"{path}: damaged, or nested in more than {DEEPEST} levels")
    kinds = _check(path, body, order, depth, left)
    parts = kinds.count(_MATRIX)
    if what == _CELL:
        sound = parts == elements
    elif what in (_STRUCT, _OBJECT):
        sound = parts % elements == 0 if elements else parts == 0
    elif what in _NUMBERS or what in (_CHAR, _SPARSE):
        most = 6 if what == _SPARSE else 4  # flags, shape, name, values; rows and columns
        sound = parts == 0 and len(kinds) == most + (flags & _COMPLEX > 0)
    else:
        sound = what in _OTHERS
    if not sound:
        raise ClutchestError(f"{path}: damaged, an array of {elements} elements holds {len(kinds)}")


def _plain(value: Any) -> Any:
    """What scipy read, as plain values."""
    fields = getattr(value, "_fieldnames", None)
    if fields is not None:
        return {name: _plain(getattr(value, name)) for name in fields}
    if isinstance(value, str):
        return value
    array = np.asarray(value)
    if array.dtype == object:
        return [_plain(each) for each in array.ravel()] if array.ndim else None
    if array.dtype.kind == "U":
        return [str(each) for each in array.ravel()]
    return array if array.dtype.kind in "iufb" and array.dtype.names is None else None


def _of_hdf5(path: Path) -> dict[str, Any]:
    required("h5py")
    import h5py

    with h5py.File(path, "r") as file:
        return _Hdf5(path, file).struct(file, 0)


class _Hdf5:
    """The values in a file of version 7.3."""

    def __init__(self, path: Path, file: Any) -> None:
        self.path, self.file = path, file
        self.parts, self.numbers = 0, 0

    def struct(self, group: Any, depth: int) -> dict[str, Any]:
        """The members of a group, without what MATLAB keeps for itself."""
        names = [name for name in group if not name.startswith("#")]
        found = {name: self.value(group[name], depth + 1) for name in names}
        return {name: value for name, value in found.items() if value is not None}

    def value(self, node: Any, depth: int) -> Any:
        """A struct, a list, a text or an array; None for an object."""
        import h5py

        self.parts += 1
        if depth > DEEPEST or self.parts > MOST_PARTS:
            raise ClutchestError(f"{self.path}: nested in more than {DEEPEST} levels")
        if "MATLAB_object_decode" in node.attrs:
            return None
        if isinstance(node, h5py.Group):
            members = self.struct(node, depth)
            return _elements(members) if _is_array(node) else members
        if "MATLAB_empty" in node.attrs:
            return np.zeros(0)
        self.numbers += node.size
        check_cells(self.path, self.numbers)
        values = node[()]
        if node.dtype == h5py.ref_dtype:
            return [self.value(self.file[each], depth + 1) for each in np.ravel(values) if each]
        if node.attrs.get("MATLAB_class") == b"char":
            return "".join(map(chr, np.ravel(values.T if values.ndim else values)))
        array = np.asarray(values)
        return np.squeeze(array.T) if array.dtype.kind in "iufb" else None


def _is_array(group: Any) -> bool:
    """Whether a group is an array of structs: every member refers to its elements, and is no cell
    array."""
    import h5py

    members = list(group.values())
    return bool(members) and all(
        isinstance(each, h5py.Dataset)
        and each.dtype == h5py.ref_dtype
        and "MATLAB_class" not in each.attrs
        for each in members
    )


def _elements(members: dict[str, Any]) -> list[dict[str, Any]]:
    """The elements of an array of structs, of which every member is a list."""
    count = min(len(each) for each in members.values())
    return [{name: each[k] for name, each in members.items()} for k in range(count)]
