"""Rows of an SQLite file that is damaged or ends early, page by page.

SQLite itself goes from page to page and stops at the first that is missing.  The pages that
hold rows (leaves of table b-trees, as "Database File Format" of sqlite.org has them) can be read
each by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from struct import error, unpack_from
from typing import Any

from clutchest.can.log_source import Bytes

_LEAF = 13
_WIDTHS = (0, 1, 2, 3, 4, 6, 8, 8, 0, 0)  # bytes of a value by its serial type
_REAL = 7


def rows(file: Bytes) -> Iterator[tuple[int, list[Any]]]:
    """(rowid, values) of every row that is wholly in a page of ``file``, from its beginning."""
    head = file.read(100)
    size = unpack_from(">H", head.ljust(100, b"\0"), 16)[0]
    size = 65536 if size == 1 else size
    if size < 512 or len(head) < 100:
        return
    file.read(size - 100)  # the first page describes the tables
    while page := file.read(size):
        if page[0] == _LEAF and len(page) >= 8:
            yield from _cells(page)


def _cells(page: bytes) -> Iterator[tuple[int, list[Any]]]:
    (count,) = unpack_from(">H", page, 3)
    for k in range(min(count, (len(page) - 8) // 2)):
        with suppress(IndexError, ValueError, error):  # a row that is not all there, or none
            yield _row(page, unpack_from(">H", page, 8 + 2 * k)[0])


def _row(page: bytes, at: int) -> tuple[int, list[Any]]:
    length, at = _varint(page, at)
    rowid, at = _varint(page, at)
    if at + length > len(page):
        raise ValueError("continues in another page")
    header, place = _varint(page, at)
    body, values = at + header, []
    while place < at + header:
        kind, place = _varint(page, place)
        width = _WIDTHS[kind] if kind < 10 else (kind - 12) // 2
        given = page[body : body + width]
        if kind == _REAL:
            values.append(unpack_from(">d", given)[0])
        elif kind >= 12:
            values.append(given)
        else:
            values.append(kind - 8 if kind in (8, 9) else int.from_bytes(given, "big", signed=True))
        body += width
    return rowid, values


def _varint(page: bytes, at: int) -> tuple[int, int]:
    """A number of seven bits a byte, and the place behind it."""
    value = 0
    for _ in range(8):
        value = value << 7 | page[at] & 0x7F
        at += 1
        if page[at - 1] < 0x80:
            return value, at
    return value << 8 | page[at], at + 1
