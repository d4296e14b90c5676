"""Reports as one page of HTML: whole in itself, with pictures, and what was found."""

from __future__ import annotations

import re
from base64 import b64decode
from dataclasses import replace
from html.parser import HTMLParser
from math import ceil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import clutchest
from clutchest.fleet.comparison import outliers
from clutchest.fleet.fleet import Fleet, FleetVehicle
from clutchest.fleet.report import fleet_page
from clutchest.identify.fit import Fit, Fitted
from clutchest.models.error_curve import ErrorCurve
from clutchest.record.discovery import pictures_of
from clutchest.record.error_curve import error_curve_words
from clutchest.record.html import page
from clutchest.record.html_reports import PANELS, diagnosis_page, discovery_page, fit_page, run_page
from discoveries import VERDICTS, discovery

VOID = ("img", "meta", "br", "hr")


class Page(HTMLParser):
    """Headings, images, and every address that a browser would load."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.images: list[str] = []
        self.open: list[str] = []
        self.feed(text)
        assert not self.open, f"not closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.loaded += [given[key] or "" for key in ("src", "href", "data") if key in given]
        if tag == "img":
            assert given["alt"]
            self.images.append(given["src"] or "")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag


def read(text: str) -> Page:
    found = Page(text)
    assert all(address.startswith("data:image/") for address in found.loaded)
    assert "url(" not in text and "@import" not in text and "<script" not in text
    for image in found.images:
        kind, _, content = image.partition(";base64,")
        if kind == "data:image/svg+xml":
            ElementTree.fromstring(b64decode(content))
        else:
            assert b64decode(content).startswith(b"\x89PNG")
    return found


def test_what_is_written_is_shown_as_it_is() -> None:
    text = page("<b>", "# a <script>x</script> | `<i>`\n\n![no picture](http://elsewhere/x.png)")
    assert "<script>" not in text and "<title>&lt;b&gt;</title>" in text
    assert not read(text).images


def test_a_run(run) -> None:
    text = run_page(run)
    pictures = ceil(len(run.estimated) / PANELS)
    assert len(read(text).images) == pictures * len(run.tracks)
    assert run.vehicle.name in text


@pytest.fixture(scope="module")
def healthy() -> clutchest.Diagnosis:
    return clutchest.diagnose("demo", "truck")


def test_a_diagnosis(healthy: clutchest.Diagnosis) -> None:
    text = diagnosis_page(healthy)
    assert len(read(text).images) == 1
    assert "no fault detected" in text and "Detection limits" in text
    assert "detected in half of all cases" in text
    for monitor in healthy.monitors:
        assert f">{monitor.name}</td>" in text


def html_of(found: clutchest.Discovery) -> str:
    return discovery_page(found, pictures_of(found))


@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_discovery(verdict: str) -> None:
    found = discovery(verdict)
    text = html_of(found)
    assert read(text).images
    assert "Detection limits" in text and "detected in half of all cases" in text
    assert found.identifiability[0].effect in text


def test_the_curve_of_an_unknown_error_is_in_physical_units() -> None:
    found = discovery("unknown")
    curve = ErrorCurve("sensor:engine_torque", "engine_speed", (60.0, 120.0), (0.0, 0.2), ())
    term = found.vehicle.machine.error_terms[curve.error_term]
    extended = replace(found.extended, curves={"curve_1": curve})
    before = len(read(html_of(replace(found, curve=None))).images)
    text = html_of(replace(found, extended=extended, curve="curve_1"))
    assert len(read(text).images) == before + 1
    words = re.search(r"The engine torque reads (\S+) (\S+) high at (\S+) rpm", text)
    assert words is not None
    assert float(words[1]) == pytest.approx(0.2 * term.size, rel=0.01)
    assert words[2] == term.unit
    assert float(words[3]) == pytest.approx(1146, abs=1)


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        (
            "sensor:engine_torque",
            (-0.46, 0.6),
            "reads 6 % high at 1146 rpm and 4.6 % low at 573 rpm",
        ),
        ("timing:engine_torque", (0.5, 0.0), "is 10 ms late at 573 rpm of engine speed."),
        ("torque", (0.0, -0.3), "The error in the equation torque is -3 % at 1146 rpm"),
    ],
)
def test_what_an_unknown_error_does_in_words(
    name: str, values: tuple[float, float], words: str
) -> None:
    found = discovery("unknown")
    curve = ErrorCurve(name, "engine_speed", (60.0, 120.0), values, ())
    extended = replace(found.extended, curves={"curve_1": curve})
    said = error_curve_words(replace(found, extended=extended, curve="curve_1"))
    assert words in said


def test_a_fit(tmp_path: Path) -> None:
    def draw(folder: Path) -> None:
        truck.with_parameters()  # nothing to draw
        (folder / "fit.png").write_bytes(b"\x89PNG")

    truck = clutchest.load_vehicle("truck")
    numbers = {
        "torque_cubic": Fitted(1.5, "Nm/mm³", 0.1, 1.3, 1.7, 0.5),
        "kiss_point": Fitted.unknown(8.0, "mm", "no ramp in these logs"),
    }
    fit = Fit("torque-curve", truck, ("a.log",), numbers, ("a note",), ("a warning",), draw)
    text = fit_page(fit, truck)
    assert len(read(text).images) == 1
    words_of = truck.machine.parameters
    what = next(p.what for p in words_of if p.key == "torque_cubic")
    for words in (
        "1.300 … 1.700 Nm/mm³",
        "no ramp in these logs",
        "a note",
        "a warning",
        "a.log",
        what,
    ):
        assert words in text
    assert "remark" in text  # a column that only what is not determined needs
    fine = {"torque_cubic": Fitted(0.03970837, "Nm/mm³", 1.4e-6, 0.03970563, 0.03971111, 0.5)}
    text = fit_page(replace(fit, parameters=fine), truck)
    assert "remark" not in text
    assert "0.0397084 ± 1.4e-06 Nm/mm³" in text and "0.03970563 … 0.03971111 Nm/mm³" in text


def test_a_fleet() -> None:
    truck = clutchest.load_vehicle("truck")
    values = [1.0, 1.01, 0.99, 1.02, 0.98, 0.5]
    vehicles = tuple(
        FleetVehicle(f"t{k}", ("a.log",), {"b.log": "damaged"}, (), {"friction": (y, 0.01)}, None)
        for k, y in enumerate(values)
    )
    compared = outliers(np.array(values), np.full(6, 0.01), 6)
    text = fleet_page(Fleet(truck, vehicles, {"friction": compared}))
    assert len(read(text).images) == 1
    assert "t5: friction" in text and "damaged" in text
