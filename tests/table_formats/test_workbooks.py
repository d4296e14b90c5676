"""Workbooks that would take memory or time without end, and what a table in a workbook may be."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pandas as pd
import pytest

from clutchest import budgets
from clutchest.errors import ClutchestError
from clutchest.reading.table_formats import load_table

pytest.importorskip("openpyxl")
SHEET = "xl/worksheets/sheet1.xml"
STRINGS = "xl/sharedStrings.xml"
MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
HEADER = '<row><c t="inlineStr"><is><t>time</t></is></c></row>'
TYPE = (
    f'<Override PartName="/{STRINGS}" ContentType="application/vnd.openxmlformats-officedocument.'
    'spreadsheetml.sharedStrings+xml"/></Types>'
)


def workbook(path: Path, parts: dict[str, str]) -> Path:
    """A workbook with these files instead of its own."""
    plain = BytesIO()
    pd.DataFrame({"time": [1.0, 2.0]}).to_excel(plain, index=False)
    with ZipFile(plain) as given, ZipFile(path, "w", ZIP_DEFLATED) as changed:
        members = {name: given.read(name).decode() for name in given.namelist()}
        types = members["[Content_Types].xml"]
        if STRINGS in parts and STRINGS not in types:
            members["[Content_Types].xml"] = types.replace("</Types>", TYPE)
        for name, content in {**members, **parts}.items():
            changed.writestr(name, content)
    return path


def sheet(rows: str) -> dict[str, str]:
    return {SHEET: f'<worksheet xmlns="{MAIN}"><sheetData>{HEADER}{rows}</sheetData></worksheet>'}


def strings(given: str) -> dict[str, str]:
    return {STRINGS: f'<sst xmlns="{MAIN}">{given}</sst>'}


def many(count: int) -> str:
    """So many empty elements."""
    return "<c/>" * count


ENTITY = f'<!DOCTYPE z [<!ENTITY a "b">]><sst xmlns="{MAIN}"><si><t>&a;</t></si></sst>'
HOSTILE = {
    "a sheet that inflates": (sheet(" " * ((8 << 20) + 1)), "inflates to 8 MiB"),
    "strings that inflate": (strings(" " * ((8 << 20) + 1)), "inflates to 8 MiB"),
    "a giant text": (sheet(f"<row><c><v>{'1' * (3 << 20)}</v></c></row>"), "MiB in one piece"),
    "a giant attribute": (sheet(f'<row r="{"1" * (3 << 20)}"/>'), "MiB in one piece"),
    "a row without an end": (sheet(f"<row>{many(300_000)}</row>"), "a row of more than"),
    "rows in rows": (sheet("<row>" * 40 + "</row>" * 40), "nested in more than"),
    "many strings": (strings("<si/>" * 300_001), "more than 300000 elements"),
    "many styles": ({"xl/styles.xml": f"<s>{many(200_001)}</s>"}, "more than 200000 elements"),
    "entities": ({STRINGS: ENTITY}, "entities of its own"),
    "a cell far away": (sheet('<row><c r="XFD9"><v>1</v></c></row>' * 9), "0.1 million cells"),
    "a row far away": (sheet('<row r="9999999999"><c><v>1</v></c></row>'), "0.1 million cells"),
    "no xml": ({SHEET: "<worksheet><sheet"}, "not a readable table"),
    "nothing": ({SHEET: f'<worksheet xmlns="{MAIN}"/>'}, "is empty"),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_a_hostile_workbook_is_refused_in_one_line(what, tmp_path, monkeypatch):
    monkeypatch.setattr(budgets, "XLSX_CELLS", 100_000)
    monkeypatch.setattr(budgets, "XLSX_SHEET", (8 << 20, 400_000))
    monkeypatch.setattr(budgets, "XLSX_STRINGS", (8 << 20, 300_000))
    parts, said = HOSTILE[what]
    with pytest.raises(ClutchestError, match=said) as caught:
        load_table(workbook(tmp_path / "x.xlsx", parts))
    assert "x.xlsx" in str(caught.value) and len(str(caught.value)) < 400


def test_cells_of_all_kinds(tmp_path, recwarn):
    """Gaps, errors, texts shared and not, whole numbers, empty rows behind the last one."""
    rows = (
        '<row><c t="inlineStr"><is><t>time</t></is></c><c t="s"><v>0</v></c><c t="s"><v>1</v></c>'
        '</row><row r="2"><c><v>0.5</v></c><c><v>7</v></c></row>'
        '<row r="4"><c r="A4"><v>1.5</v></c><c r="C4" t="e"><v>#DIV/0!</v></c></row>'
        '<row r="5"><c r="A5"><v>2</v></c><c r="C5" t="str"><v>word</v></c><c r="Z5"/></row>'
        '<row r="9"/>'
    )
    parts = {SHEET: f'<worksheet xmlns="{MAIN}"><sheetData>{rows}</sheetData></worksheet>'}
    given = strings("<si><t>speed</t></si><si><t>note</t></si>")
    table = load_table(workbook(tmp_path / "x.xlsx", parts | given))
    assert list(table.units) == ["time", "speed", "note"] and table.rows == 4
    np.testing.assert_array_equal(table.column("time").value, [0.5, np.nan, 1.5, 2.0])
    np.testing.assert_array_equal(table.column("speed").value, [7.0, np.nan, np.nan, np.nan])
    assert table.column("note").given.tolist() == [False, False, False, True]
    own = [str(w.message) for w in recwarn if not issubclass(w.category, ResourceWarning)]
    assert own == [], "files that other tests left open are collected at any time"
