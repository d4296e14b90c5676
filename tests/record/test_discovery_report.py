"""The files of a discovery, each verdict's words, and its recording read back."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from io import StringIO

import numpy as np
import pandas as pd
import pytest
from rerun.chunk import RrdReader
from rerun.components import AggregationPolicy
from rich.console import Console

from clutchest.discovery.misfit_picture import most_significant, pieces, worst_stretch
from clutchest.discovery.result import Experiment, Identifiable, either
from clutchest.discovery.where import Where
from clutchest.models import machine_of
from clutchest.record.discovery import write_discovery
from clutchest.record.discovery_recording import write_discovery_recording
from clutchest.record.discovery_report import gain_words, next_commands, report, title
from clutchest.record.discovery_terminal import print_discovery, print_identifiable
from clutchest.shown import with_unit
from clutchest.vehicle import load_vehicle
from discoveries import CURVE, FADE, GAIN, LINE, NO_GAIN, VERDICTS, discovery, misfit

COMPARED = machine_of("dry_clutch").compared
OWN = """
from clutchest.models.effects import Effect, Number

class Own(Effect):
    name, model, equation = "own", "dry_clutch", "torque"
    parameters = (Number("scale", "mm", -1.0, 1.0),)
"""
FILES = [
    "discovery.json",
    "extended.toml",
    "misfit.png",
    "recording.rrd",
    "report.html",
    "report.md",
]


def no_constant(name):
    raise AssertionError(f"{name} is not JSON")


def printed(found) -> str:
    text = StringIO()
    console = Console(file=text, width=200)
    print_identifiable(found.identifiability, console)
    print_discovery(found, console)
    return text.getvalue()


def recorded(path) -> tuple[dict[str, pd.DataFrame], dict[str, pd.DataFrame], str]:
    """Entity → rows over time, entity → static row, and what the blueprint's views show."""
    reader = RrdReader(path)
    moving: dict[str, list[pd.DataFrame]] = {}
    static: dict[str, list[pd.DataFrame]] = {}
    for chunk in reader.stream().to_chunks():
        group = static if chunk.is_static else moving
        group.setdefault(chunk.entity_path, []).append(chunk.to_record_batch().to_pandas())
    (store,) = reader.blueprints()
    cells = [c.to_record_batch().to_pydict() for c in reader.stream(store=store).to_chunks()]
    names = ("ViewContents:query", "ViewBlueprint:space_origin")
    shown = [str(cell[name]) for cell in cells for name in names if name in cell]
    tables = {n: pd.concat(p).sort_values("time", kind="stable") for n, p in moving.items()}
    return tables, {n: pd.concat(p) for n, p in static.items()}, "".join(shown)


def values(table: pd.DataFrame) -> np.ndarray:
    return np.array([cell[0] for cell in table["Scalars:scalars"]])


def seconds(table: pd.DataFrame) -> np.ndarray:
    return table["time"].to_numpy().astype("timedelta64[ns]").astype(np.int64) * 1e-9


@pytest.mark.parametrize("gain", [GAIN, None], ids=["held out", "nothing held out"])
@pytest.mark.parametrize("verdict", VERDICTS)
def test_files(tmp_path, verdict, gain):
    found = discovery(verdict, gain)
    out = tmp_path / "deep" / "out"
    written = write_discovery(found, out)
    assert [p.name for p in written] == FILES == sorted(p.name for p in out.iterdir())
    told = json.loads((out / "discovery.json").read_text("utf-8"), parse_constant=no_constant)
    assert told["verdict"] == verdict and (told["gain"] is None) == (gain is None)
    again = load_vehicle(out / "extended.toml")
    assert dict(again.effects) == dict(found.extended.effects)
    assert again.curves == found.extended.curves
    assert replace(again, effects={}, curves={}) == found.vehicle
    assert (out / "misfit.png").read_bytes()[:4] == b"\x89PNG"
    assert "(misfit.png)" in (out / "report.md").read_text("utf-8")


@pytest.mark.parametrize("machine", ["dry_clutch", "alsd"])
def test_what_a_log_can_tell_is_whole_on_80_columns(machine):
    effects = machine_of(machine).effects.values()
    longest = max((effect.name for effect in effects), key=len)
    tells = [
        Identifiable(effect.name, n.unit, 0.00123456, n.upper, longest, 12.3)
        for effect in effects
        for n in effect.gains
    ]
    text = StringIO()
    print_identifiable(tells, Console(file=text, width=80))
    said = text.getvalue()
    assert "…" not in said
    assert max(map(len, said.splitlines())) <= 80
    for effect in effects:
        assert re.search(rf"^{effect.name} +0\.00123 .* {longest[:12]}.* 12\.3 *$", said, re.M)
        for number in effect.gains:
            assert set(with_unit("", number.unit).split()) <= set(said.split())
    assert re.search("_(\n.* )?".join(longest.split("_")), said)  # it may go on in the next line


def test_numbers_that_are_not_finite_become_null(tmp_path):
    found = discovery("named", replace(GAIN, simulation_rmse_after=float("nan")))
    blind = Identifiable("wear", "mm", float("inf"), 3.0, None, None)
    write_discovery(replace(found, identifiability=(blind,)), tmp_path)
    told = json.loads((tmp_path / "discovery.json").read_text("utf-8"), parse_constant=no_constant)
    assert told["gain"]["simulation_rmse_after"] is None
    assert told["identifiability"]["wear"]["detectable_size"] is None


@pytest.mark.slow
def test_a_curve_stays_in_the_vehicle_that_is_extended_again(tmp_path):
    write_discovery(discovery("unknown"), tmp_path)
    vehicle = load_vehicle(tmp_path / "extended.toml")
    assert vehicle.curves == {"curve_1": CURVE}
    # nothing more is identified on top of it
    write_discovery(replace(discovery("none"), vehicle=vehicle, extended=vehicle), tmp_path)
    assert load_vehicle(tmp_path / "extended.toml").curves == vehicle.curves
    # another curve, into the folder of the first
    second = replace(vehicle, curves={**vehicle.curves, "curve_2": CURVE})
    write_discovery(replace(discovery("unknown"), vehicle=vehicle, extended=second), tmp_path)
    assert load_vehicle(tmp_path / "extended.toml").curves == second.curves


def test_a_failed_write_leaves_what_was_there(tmp_path, monkeypatch):
    write_discovery(discovery("named"), tmp_path)
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}

    def full(*_, **__):
        raise OSError("no space left")

    monkeypatch.setattr("clutchest.discovery.misfit_picture.draw_misfit", full)
    with pytest.raises(OSError, match="no space"):
        write_discovery(discovery("unknown"), tmp_path)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


@pytest.mark.parametrize("tell", [report, printed], ids=["report", "terminal"])
def test_words_of_each_verdict(tell):
    texts = {verdict: " ".join(tell(discovery(verdict)).split()) for verdict in VERDICTS}
    for verdict, text in texts.items():
        assert f"In one sentence: {verdict}." in text
        assert "parameter 'kiss_point' is a guess" in text
        assert "Not detectable in this log even at the largest plausible size: housing_air" in text
    assert "slope 0.123 ± 0.011 per 100 K, onset 160 °C" in texts["named"]
    assert "81.3" in texts["named"] and "3e-15" in texts["named"]
    assert (
        "in the equation torque and correlates with disc temperature, then with slip speed"
        in (texts["named"])
    )
    assert "amount 0.410 ± 0.060 mm" in texts["ambiguous"]
    assert "offset -0.400 ± 0.060 mm" in texts["ambiguous"]
    assert "Slip in steps at one position." in texts["ambiguous"]
    assert (
        "in the time stamps of engine_torque and correlates with position rate."
        in (texts["unknown"])
    )
    for verdict in ("named", "ambiguous", "unknown"):
        assert "friction_level" in texts[verdict] and "33 times less likely" in texts[verdict]
        assert "10¹³ times less likely" in texts[verdict]
        assert texts[verdict].index("friction_level") < texts[verdict].index("centrifugal")
    assert "less likely" not in texts["none"] and "The error" not in texts["none"]


def test_a_report_begins_with_whether_the_model_fits():
    fits, misfits = (
        report(discovery("none")).split("\n\n"),
        report(discovery("named")).split("\n\n"),
    )
    assert (
        fits[2]
        == "Does the model fit? The residuals are consistent with noise (p = 0.43, all tests)."
    )
    assert fits[1] == "Vehicle: truck. Log: monday.log, tuesday.log."
    assert fits[3].startswith("**")
    assert (
        "The residuals are not noise (p = 2e-07, all tests): engine_speed while slipping."
        in misfits[2]
    )
    assert LINE in misfits[3] and "residuals are positive" not in misfits[3], "not significant"
    assert "The same test of the extended model: p = 0.43." in misfits[4]
    assert "consistent with noise" in printed(discovery("none"))


def test_noise_that_is_none_names_no_equation():
    where = Where("sensor:engine_speed", (), distorted=True)
    found = replace(discovery("unknown"), where=where)
    assert "The error is in" not in report(found) + printed(found)
    assert title(found) == "the equations explain the data, but not their noise"


def test_the_gain_says_whether_it_pays():
    assert "rises by 134.2 [95 %: 98.1 to 170.3]" in gain_words(GAIN, COMPARED)
    assert "not significant" not in gain_words(GAIN, COMPARED)
    assert "[95 %: -1.2 to 2.3]" in gain_words(
        NO_GAIN, COMPARED
    ) and "not significant" in gain_words(NO_GAIN, COMPARED)
    assert "Not measured: no held-out data (`--holdout LOG`)" in report(discovery("named", None))
    assert "Not measured: no held-out data (`--holdout LOG`)" in printed(discovery("named", None))


def test_a_loss_is_told_as_one():
    lost = gain_words(replace(GAIN, nll_after=909.6, ci95=(-19.2, -4.0)), COMPARED)
    assert "ln L falls by 9.6 [95 %: 4.0 to 19.2]" in lost
    assert "makes the prediction worse" in lost and "not significant" not in lost


def test_why_nothing_was_measured():
    assert "No cause was identified" in report(discovery("none", None))
    held_out = {**discovery("unknown").provenance, "held_out": "wednesday.log"}
    curveless = replace(discovery("unknown", None), provenance=held_out)
    for words in (report(curveless), printed(curveless)):
        assert "could not be added to the model as a curve" in words and "Not measured" not in words


def test_no_torque_is_told_that_was_not_computed():
    parted = replace(GAIN, simulation_rmse_after=None)
    assert "torque" in gain_words(GAIN, COMPARED) and "torque" not in gain_words(parted, COMPARED)
    assert "predicted standard deviation changes from 1.420 to 1.010." in gain_words(
        parted, COMPARED
    )


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        ([["a"]], "a"),
        ([["a", "b"]], "a and b"),
        ([["a"], ["b"], ["c"]], "one of a, b, c"),
        ([["a", "b"], ["a", "c"]], "a and one of b, c"),
        ([["a", "b"], ["c", "d"]], "one of: a and b; c and d"),
        ([["a", "b"], ["a", "c"], ["d", "c"]], "one of: a and b; a and c; d and c"),
    ],
)
def test_sets_of_causes_in_words(sets, words):
    assert either(sets) == words


def test_the_gain_says_on_what_it_was_measured():
    assert gain_words(GAIN, COMPARED).startswith("On held-out data ln L rises")
    alone = gain_words(replace(GAIN, other_logs=False), COMPARED)
    assert alone.startswith("Cross-validated over quarters of the log, ln L rises")


def test_the_report_says_what_the_extended_vehicle_holds():
    holds = "`extended.toml` has {} in its model: "
    assert holds.format("friction_fade") in report(discovery("named"))
    assert holds.format("wear") in report(discovery("ambiguous"))
    patched = report(discovery("unknown"))
    assert holds.format("curve_1") in patched and "names no cause" in patched
    assert "Nothing was added: `extended.toml` is truck.toml as it was." in report(
        discovery("none")
    )


def test_what_could_be_told_is_printed():
    lines = printed(discovery("none")).splitlines()
    (fade,) = [line for line in lines if "friction_fade" in line]
    assert fade.replace("│", " ").split() == [
        "friction_fade",
        "0.05",
        "0.4",
        "per",
        "100",
        "K",
        "friction_temperature",
        "7.2",
    ]
    assert any("viscous_drag" in line and "never" in line for line in lines)


def test_the_next_manoeuvre_is_a_command(tmp_path):
    found = discovery("ambiguous")
    (command,) = next_commands(found)
    assert command.startswith("clutchest simulate --vehicle truck --scenario slip-steps --seed ")
    assert f"```sh\n{command}\n```" in report(found)
    # in a narrow terminal it can still be copied as one line
    text = StringIO()
    print_discovery(found, Console(file=text, width=40))
    assert command in text.getvalue()
    own = replace(found, vehicle=replace(found.vehicle, path=tmp_path / "my truck.toml"))
    assert f"--vehicle '{tmp_path / 'my truck.toml'}' " in next_commands(own)[0]
    words = replace(found, experiment=Experiment("Measure the pads.", None))
    assert next_commands(words) == [] and "Measure the pads." in report(words)


def test_effects_of_the_users_own_keep_their_units(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(OWN, encoding="utf-8")
    found = discovery("named")
    cause = replace(FADE, effect="own", parameters={"scale": FADE.parameters["slope"]})
    extended = replace(found.vehicle, effects_files=(file,))
    text = report(replace(found, causes=(cause,), extended=extended))
    assert "scale 0.123 ± 0.011 mm" in text


def test_slips_are_parted_where_time_has_a_hole():
    time = np.concatenate([np.arange(0.0, 1.0, 0.1), np.arange(5.0, 6.0, 0.1), [9.0]])
    assert list(pieces(time)) == [slice(0, 10), slice(10, 20), slice(20, 21)]
    assert list(pieces(np.repeat(time[:20], 3))) == [slice(0, 30), slice(30, 60)]
    assert list(pieces(np.array([]))) == []
    assert list(pieces(np.array([2.0]))) == [slice(0, 1)]


def test_the_worst_slip_is_the_one_shown():
    shown = misfit(drives=2)
    drive, piece = worst_stretch(shown)
    assert drive == 1 and shown.torque[1][0][piece][0] == 40.0
    nothing = tuple(np.array([]) for _ in range(4))
    assert worst_stretch(replace(shown, torque=(nothing, nothing))) is None


def test_bins_of_the_first_driver_that_tell_most():
    shown = misfit()
    assert most_significant(shown.bins, "temp_disc", False) is shown.bins[0]
    assert most_significant(shown.bins, "slip_speed", False) is shown.bins[2]
    assert most_significant(shown.bins, "time", False) is None


def test_bins_of_an_extended_model_are_those_that_it_mended():
    first, second, third = misfit().bins[:3]
    bins = (replace(first, after=first.mean), replace(second, after=0.0 * second.mean), third)
    assert most_significant(bins, "temp_disc", True) is bins[1]
    assert most_significant(bins, "temp_disc", False) is bins[0]


def titles(found) -> str:
    return "\n".join(axes.get_title("left") for axes in found.plot().axes)


def test_a_model_that_is_right_is_shown_over_its_strongest_driver():
    strongest = Where("torque", ("slip_speed", "temp_disc"), p_value=0.414)
    found = replace(discovery("none"), strongest=strongest)
    assert "strongest driver, not established (p = 0.41)" in titles(found)
    assert found.plot().axes[1].get_xlabel().startswith("slip speed")
    words = "in the equation torque with slip speed (p = 0.41, all curves)."
    assert "No correlation of the residuals is established." in report(found)
    assert words in report(found)
    assert found.summary()["strongest"]["p_value"] == 0.414
    for verdict in VERDICTS:
        assert "not established" not in titles(discovery(verdict)) + report(discovery(verdict))


def test_where_no_driver_was_tested_residuals_are_shown_over_time():
    found = discovery("none")
    over_time = replace(found.misfit.bins[0], covariate="time")
    found = replace(found, misfit=replace(found.misfit, bins=(*found.misfit.bins, over_time)))
    assert found.plot().axes[1].get_xlabel().startswith("time")


def test_a_drive_without_slip_or_bins_has_a_picture_too(tmp_path):
    found = discovery("unknown")
    nothing = tuple(np.array([]) for _ in range(4))
    found = replace(found, misfit=replace(found.misfit, torque=(nothing,), bins=()))
    found.plot().savefig(tmp_path / "misfit.png")
    assert (tmp_path / "misfit.png").stat().st_size > 1000
    write_discovery_recording(found, tmp_path / "recording.rrd")
    moving, _, _ = recorded(tmp_path / "recording.rrd")
    assert "/residual/engine_speed" in moving and "/clutch_torque/measured" not in moving


def test_recording(tmp_path):
    found = discovery("named")
    write_discovery_recording(found, tmp_path / "recording.rrd")
    moving, static, views = recorded(tmp_path / "recording.rrd")
    lines = ["measured", "simulated", "extended"]
    assert set(moving) == {
        *(f"/clutch_torque/{name}" for name in lines),
        *(f"/residual/{s}{e}" for s in found.misfit.sensors for e in ("", "/extended")),
    }
    time, *columns = found.misfit.torque[0]
    for name, column in zip(lines, columns, strict=True):
        table = moving[f"/clutch_torque/{name}"]
        shown = values(table)
        gap = np.flatnonzero(np.isnan(shown))
        assert len(gap) == 1  # the line breaks between the two slips
        np.testing.assert_array_equal(np.delete(shown, gap), column)
        np.testing.assert_allclose(np.delete(seconds(table), gap), time, atol=1e-9)
    own = found.misfit.sensor[0] == 0
    for entity, column in (("", found.misfit.before), ("/extended", found.misfit.after)):
        table = moving[f"/residual/engine_speed{entity}"]
        np.testing.assert_array_equal(values(table), column[0][own])
        policy = static[f"/residual/engine_speed{entity}"]["SeriesLines:aggregation_policy"]
        assert [list(cell) for cell in policy] == [[AggregationPolicy.MinMax.value]]
    text = static["/report"]["TextDocument:text"].iloc[0][0]
    assert text == report(found) and "misfit.png" not in text
    for entity in moving:
        assert f"'{entity}'" in views, entity
    assert "/report" in views


def test_recording_of_a_model_that_is_right_shows_no_extension(tmp_path):
    write_discovery_recording(discovery("none"), tmp_path / "recording.rrd")
    moving, _, views = recorded(tmp_path / "recording.rrd")
    assert "/clutch_torque/simulated" in moving
    assert not any("extended" in entity for entity in moving) and "extended" not in views


def test_recording_of_several_drives(tmp_path):
    found = discovery("named", drives=2)
    write_discovery_recording(found, tmp_path / "recording.rrd")
    moving, _, _ = recorded(tmp_path / "recording.rrd")
    states = [cell[0] for cell in moving["/drive"]["StateChange:state"]]
    assert states[:2] == ["drive 0", "drive 1"]
    second = seconds(moving["/drive"])[1]
    assert second > found.misfit.time[0][-1]
    table = moving["/residual/engine_speed"]
    own = found.misfit.sensor[1] == 0
    np.testing.assert_array_equal(
        values(table)[seconds(table) > second][-own.sum() :], found.misfit.before[1][own]
    )


def test_a_spike_stays_in_the_recording_and_out_of_its_range(tmp_path):
    found = discovery("named")
    write_discovery_recording(found, tmp_path / "recording.rrd")
    reader = RrdReader(tmp_path / "recording.rrd")
    (store,) = reader.blueprints()
    ranges = [
        cells["ScalarAxis:range"][0][0]
        for chunk in reader.stream(store=store).to_chunks()
        if "ScalarAxis:range" in (cells := chunk.to_record_batch().to_pydict())
    ]
    moving, _, _ = recorded(tmp_path / "recording.rrd")
    spike = max(values(moving[f"/residual/{s}"]).max() for s in found.misfit.sensors)
    assert spike > 38.0
    assert min(high for _, high in ranges) < 10.0


def test_nothing_on_the_terminal(tmp_path, capfd):
    write_discovery(discovery("named"), tmp_path)
    assert capfd.readouterr() == ("", "")


def test_the_report_says_what_it_was_made_from():
    assert report(discovery("none")).endswith(
        "From monday.log, tuesday.log (not used of 2000 frames: 20 checksum) by clutchest 0.1.0.\n"
    )


def test_causes_are_a_table_too():
    table = discovery("named").to_pandas()
    size = FADE.parameters["slope"]
    row = table[table["parameter"] == "slope"].iloc[0]
    assert (row["effect"], row["value"], row["std"]) == ("friction_fade", size.value, size.std)
    none = discovery("none").to_pandas()
    assert len(none) == 0 and list(none) == list(table)


def test_a_number_that_does_not_change_is_not_said_to():
    words = gain_words(replace(GAIN, rmse_before=0.5971, rmse_after=0.5969), None)
    assert "stays at 0.597." in words and "changes" not in words
    assert "changes from 1.420 to 1.010" in gain_words(GAIN, None)
