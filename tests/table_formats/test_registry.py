"""Each kind of table is one module; the page of files has what they say of themselves."""

from __future__ import annotations

from pathlib import Path

from clutchest.extras import EXTRAS
from clutchest.reading.table_formats import table_formats
from clutchest.reading.table_kind import TableKind

ROOT = Path(__file__).parents[2]
HEAD = "| suffix | what | read | written | needs |\n|---|---|---|---|---|\n"


def row(kind: TableKind) -> str:
    """The row of a kind in docs/files.md."""
    suffixes = ", ".join(f"`{suffix}`" for suffix in kind.suffixes)
    needs = f"`clutchest[{kind.extra}]`" if kind.extra else ""
    cells = (suffixes, kind.about, "yes" if kind.read else "", "yes" if kind.write else "", needs)
    return "| " + " | ".join(cells) + " |"


def test_the_documentation_has_every_kind():
    text = (ROOT / "docs" / "files.md").read_text(encoding="utf-8")
    _, _, behind = text.partition(HEAD)
    rows = behind.partition("\n\n")[0].splitlines()
    assert rows == [row(kind) for kind in table_formats()]


def test_every_kind_is_read_or_written_and_no_suffix_is_of_two():
    suffixes = [suffix for kind in table_formats() for suffix in kind.suffixes]
    assert len(suffixes) == len(set(suffixes)) > 0
    assert all(kind.read or kind.write for kind in table_formats())
    assert {kind.extra for kind in table_formats()} - {""} <= set(EXTRAS.values())
