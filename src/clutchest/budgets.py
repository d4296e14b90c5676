"""Budgets: what an input may ask for, so that reading it ends, in bounded time and memory.

One table for every reader.  Whatever exceeds its budget is refused in one line, before the work is
done; every input below 100 MB is read within a GiB, or refused.
"""

from __future__ import annotations

from pathlib import Path

from clutchest.errors import ClutchestError

VEHICLE_BYTES = 4 << 20  # of a vehicle file, with its curves
STATE_BYTES = 16 << 20  # of a state.json
DBC_BYTES = 8 << 20  # of a DBC; cantools needs some hundred times as much
REPAIRED_BYTES = 64 << 20  # of a DBC that is read anew after each repair, all times together
UNPACKED_BYTES = 256 << 20  # of a compressed file that can only be read whole
TEXT_BYTES = 2 << 30  # of a compressed table, inflated block by block
LINE_BYTES = 16 << 20  # of one line of a table
LOG_FRAMES = 20_000_000  # of a log, or as many as its file has bytes
LOG_RATIO = (4 << 30, 100)  # bytes of an inflated log, or so many times its file's
HELD_BYTES = (192 << 20, 2)  # of a log's frames held together, or so many times its file's
TABLE_CELLS = 30_000_000  # numbers of a table, or one for so many bytes of its file:
TEXT_CELL, BINARY_CELL = 2, 4  # of a text, of a binary file
TABLE_WORDS = 128 << 20  # bytes of all texts of a column
XLSX_CELLS = 5_000_000  # of the first sheet of a workbook; 7 µs and a hundred bytes for each
XLSX_SHEET = (512 << 20, 4 * XLSX_CELLS)  # bytes and elements of a sheet, inflated
XLSX_STRINGS = (64 << 20, 4_000_000)  # of the strings that its cells refer to
XLSX_PART = (64 << 20, 200_000)  # of any other part of a workbook
XLSX_ROW = 1 << 18  # elements of the file between one row and the next
XLSX_CELL_BYTES = 1 << 20  # between one tag and the next
SQLITE_STEPS = (10_000_000, 50)  # of SQLite's machine: so many, and per byte of the file
SQLITE_VALUE_BYTES = 1 << 16  # of one value in an SQLite file
MF4_BLOCKS = 400_000  # blocks that describe an MDF4 file; asammdf takes 1.3 kB, 60 µs for each
MESSAGE_BITS = 1785 * 8  # of the longest message, one of J1939's transport protocol
FRAME_BITS = 1 << 17  # of the longest message of a database that is no DBC
ARXML_PDUS = 200_000  # PDUs that are read, each as often as others refer to it
LONGEST_RANGE = 1 << 18  # multiplexer values of all signals of a DBC together
LARGEST = 1e30  # of a number that a person states
LONGEST_DELAY_S = 60.0  # of a signal behind the others


def within(path: Path, bytes_: int, what: str) -> None:
    """Raises ClutchestError for a file of more than so many bytes."""
    size = path.stat().st_size
    if size > bytes_:
        raise ClutchestError(
            f"{path}: {size >> 20} MiB are too many for {what}, expected at most {bytes_ >> 20}"
        )


def by_size(path: Path, budget: tuple[int, int]) -> int:
    """So many bytes, or so many times those of the file at ``path``."""
    return max(budget[0], budget[1] * path.stat().st_size)


def cells(path: Path, per_cell: int) -> int:
    """How many numbers a table in the file at ``path`` may hold, of so many bytes each."""
    return max(TABLE_CELLS, path.stat().st_size // per_cell)
