"""Workbooks within their budget: what openpyxl would hold in memory is counted before it reads."""

from __future__ import annotations

from contextlib import suppress
from math import inf
from pathlib import Path
from typing import IO
from xml.parsers import expat
from zipfile import ZipFile

from clutchest import budgets
from clutchest.errors import ClutchestError

_DEEPEST = 32  # elements within elements
_PIECE = 1 << 20


def check_workbook(path: Path) -> None:
    """Raises ClutchestError for a workbook whose parts inflate, or hold elements, beyond their
    budget; never more bytes of one are read than the archive states.  A picture, or a part that is
    damaged, is as good as empty from where it is no XML: openpyxl says so of one that it reads."""
    with ZipFile(path) as book:
        for member in book.infolist():
            name = member.filename
            most_bytes, most = budgets.XLSX_PART
            most_in_row = inf
            if name.startswith("xl/worksheets/"):
                (most_bytes, most), most_in_row = budgets.XLSX_SHEET, budgets.XLSX_ROW
            elif name == "xl/sharedStrings.xml":
                most_bytes, most = budgets.XLSX_STRINGS
            if member.file_size > most_bytes:
                raise _too_large(path, name, f"inflates to {member.file_size >> 20} MiB")
            with book.open(member) as part, suppress(expat.ExpatError):
                _Part(path, name, most, most_in_row).check(part)


def _too_large(path: Path, name: str, why: str) -> ClutchestError:
    return ClutchestError(
        f"{path}: its '{name[:60]}' {why}; save so large a table as csv or Parquet"
    )


class _Part:
    """One XML file of a workbook, of at most so many elements, in all and from one row to the
    next."""

    def __init__(self, path: Path, name: str, most: int, most_in_row: float) -> None:
        self.path, self.name, self.most, self.most_in_row = path, name, most, most_in_row
        self.elements = self.in_row = self.depth = 0
        self.last = 0  # byte of the last tag
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.StartDoctypeDeclHandler = self._doctype

    def check(self, part: IO[bytes]) -> None:
        """Raises ClutchestError beyond the budget."""
        fed = 0
        while piece := part.read(_PIECE):
            self.parser.Parse(piece, False)
            fed += len(piece)
            if fed - self.last > 2 * budgets.XLSX_CELL_BYTES:
                raise self._refused(f"holds {fed - self.last >> 20} MiB in one piece")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._tag()
        self.elements, self.in_row, self.depth = self.elements + 1, self.in_row + 1, self.depth + 1
        if name.endswith("row"):
            self.in_row = 0
        if self.elements > self.most:
            raise self._refused(f"holds more than {self.most} elements")
        if self.in_row > self.most_in_row:
            raise self._refused(f"holds a row of more than {self.most_in_row} elements")
        if self.depth > _DEEPEST:
            raise self._refused(f"is nested in more than {_DEEPEST} levels")

    def _end(self, name: str) -> None:
        self._tag()
        self.depth -= 1

    def _tag(self) -> None:
        at = self.parser.CurrentByteIndex
        if at - self.last > budgets.XLSX_CELL_BYTES:
            raise self._refused(f"holds {at - self.last >> 20} MiB in one piece")
        self.last = at

    def _doctype(self, *_: object) -> None:
        raise self._refused("defines entities of its own")

    def _refused(self, why: str) -> ClutchestError:
        return _too_large(self.path, self.name, why)
