"""The site of the manual is made without a warning, and the notebooks run."""

from __future__ import annotations

import importlib
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))


def test_there_are_four_notebooks() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["diagnose", "discover", "fleet", "replay"]


def test_every_table_of_the_results_names_the_command_that_made_it() -> None:
    """One that is there, in the table's section."""
    sections = []
    for name in ("results.md", "performance.md"):
        page = (ROOT / "docs" / name).read_text(encoding="utf-8")
        sections += re.split(r"(?m)^##+ ", page)[1:]
    assert len(sections) > 15
    for section in sections:
        if re.search(r"(?m)^\|", section):
            named = re.findall(r"(?:python|pytest)[^`\n|]*?((?:benchmarks|tests)[\w/.]*)", section)
            assert named, section.splitlines()[0]
            assert all((ROOT / path).exists() for path in named), named


def heading(line: str) -> str:
    """What a link to a heading calls it."""
    return re.sub(r"[^\w\- ]", "", line.lstrip("# ").lower()).replace(" ", "-")


def test_one_command_measures_every_table_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """What it runs is there, and so is the heading where the numbers go."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    results = importlib.import_module("results")
    assert len({table.name for table in results.TABLES}) == len(results.TABLES)
    for table in results.TABLES:
        for command in table.command.split(" && "):
            (path,) = re.findall(r"(?:benchmarks|tests)[\w/.]*", command)
            assert (ROOT / path).exists(), command
        lines = table.page.read_text(encoding="utf-8").splitlines()
        headings = {heading(line) for line in lines if line.startswith("#")}
        assert table.place.partition("#")[2] in headings | {""}, table.place


def test_what_was_printed_stands_between_the_marks_of_its_page() -> None:
    results = runpy.run_path(str(ROOT / "benchmarks" / "results.py"))
    table, written = results["TABLES"][0], results["written"]
    page = f"before\n{table.mark}\nold\n<!-- end -->\nafter\n"
    new = written(page, table, "a  1\n\n")
    assert new == (
        f"before\n{table.mark}\n```text\n$ {table.command}\na  1\n```\n<!-- end -->\nafter\n"
    )
    assert written(new, table, "a  1\n") == new and written("none\n", table, "x") == "none\n"
    with pytest.raises(ValueError, match="no <!-- end -->"):
        written(page.replace("<!-- end -->", ""), table, "x")


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From top to bottom; a cell that raises ends it."""
    nbformat, client = map(importlib.import_module, ("nbformat", "nbclient"))  # of the extra "test"
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    book = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in book.cells), "is kept without what it prints"
    where = {"metadata": {"path": str(tmp_path)}}
    client.NotebookClient(book, timeout=900, kernel_name="python3", resources=where).execute()


@pytest.mark.slow
def test_the_site_has_no_warning(tmp_path: Path) -> None:
    """A link that leads nowhere is one."""
    pytest.importorskip("material")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(tmp_path / "site")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    names = (tmp_path / "site" / "api" / "index.html").read_text(encoding="utf-8")
    assert "analyse_fleet" in names
    pages = list((tmp_path / "site").rglob("*.html"))
    assert len(pages) > 20
    for page in pages:
        assert "https://fonts." not in page.read_text(encoding="utf-8"), page
