"""Measurements of MATLAB and of LabVIEW: the layouts that their tools write."""

from __future__ import annotations

import gzip
import struct
import zlib
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from scipy.io import savemat

from clutchest.errors import ClutchestError
from clutchest.reading import read_log
from clutchest.reading.table_formats import is_table
from clutchest.reading.table_inspection import inspect_tables
from clutchest.record.inspection_terminal import print_table_inspection
from clutchest.vehicle import TableColumn
from table_rows import RPM, SPEED, TIME, N

SLOW, WATER = TIME[::10], np.full(N // 10, 85.0)
COLUMNS = {"engine_speed": TableColumn("nEng", "rpm"), "coolant_temp": TableColumn("T_KMT", "°C")}


@pytest.fixture(scope="module")
def car(truck):
    return replace(truck, columns=COLUMNS)


def hdf5(path: Path, variables: dict[str, Any]) -> None:
    """As MATLAB writes version 7.3: columns first, text as numbers, arrays of structs by
    reference."""
    h5py = pytest.importorskip("h5py")

    def put(group: Any, name: str, value: Any) -> None:
        if isinstance(value, dict):
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, each in value.items():
                put(inner, key, each)
        elif isinstance(value, list):
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            for key in value[0]:
                for number, each in enumerate(value):
                    put(file["#refs#"], f"{name}{key}{number}", each[key])
                refs = [file["#refs#"][f"{name}{key}{k}"].ref for k in range(len(value))]
                inner.create_dataset(key, data=np.array(refs, h5py.ref_dtype)[:, None])
        elif isinstance(value, str):
            text = np.frombuffer(value.encode("utf-16-le"), np.uint16)
            group.create_dataset(name, data=text[:, None]).attrs["MATLAB_class"] = np.bytes_("char")
        else:
            matrix = np.atleast_2d(np.asarray(value, np.float64))
            matrix = matrix.T if np.ndim(value) == 2 else matrix
            group.create_dataset(name, data=matrix).attrs["MATLAB_class"] = np.bytes_("double")

    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_group("#refs#")
        for name, value in variables.items():
            put(file, name, value)
    with path.open("r+b") as block:
        block.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def version_5(path: Path, variables: dict[str, Any]) -> None:
    def of(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: of(each) for key, each in value.items()}
        return _structs([of(each) for each in value]) if isinstance(value, list) else value

    savemat(path, {k: of(v) for k, v in variables.items()}, do_compression=True, oned_as="column")


def _structs(values: list[dict[str, Any]]) -> np.ndarray:
    """A struct array as savemat takes it."""
    given = np.zeros((1, len(values)), [(key, object) for key in values[0]])
    for k, each in enumerate(values):
        for key, value in each.items():
            given[0, k][key] = value
    return given


LAYOUTS = {
    "workspace": {"time": TIME, "nEng": SPEED / RPM, "T_KMT": np.full(N, 85.0), "map": np.eye(3)},
    "struct": {"m": {"time": TIME, "nEng": SPEED / RPM, "T_KMT": np.full(N, 85.0)}},
    "two rates": {
        "fast": {"time": TIME, "nEng": SPEED / RPM},
        "slow": {"t": SLOW, "T_KMT": WATER},
    },
    "times and data": {
        "nEng": {"time": TIME, "data": SPEED / RPM, "unit": "rpm"},
        "T_KMT": {"time": SLOW, "data": WATER},
    },
    "Simulink": {
        "out": {
            "time": TIME,
            "signals": [
                {"values": SPEED / RPM, "label": "nEng"},
                {"values": np.full(N, 85.0), "label": "T_KMT"},
            ],
        }
    },
    "ControlDesk": {
        "exp1": {
            "X": [{"Data": TIME, "Name": "fast"}, {"Data": SLOW, "Name": "slow"}],
            "Y": [
                {"Name": "nEng", "Data": SPEED / RPM, "XIndex": 1.0, "Unit": "rpm"},
                {"Name": "T_KMT", "Data": WATER, "XIndex": 2.0, "Unit": "degC"},
            ],
        }
    },
    "pairs": {"nEng": np.stack([TIME, SPEED / RPM], 1), "T_KMT": np.stack([SLOW, WATER], 1)},
}


@pytest.mark.parametrize("write", [version_5, hdf5], ids=["5", "7.3"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_of_a_mat_file(layout, write, car, tmp_path):
    path = tmp_path / "m.mat"
    write(path, LAYOUTS[layout])
    assert is_table(path)
    signals = read_log(path, car)
    np.testing.assert_allclose(signals["engine_speed"].time, TIME, atol=1e-12)
    np.testing.assert_allclose(signals["engine_speed"].value, SPEED, rtol=1e-12)
    assert set(signals["coolant_temp"].value) == {85.0}
    assert signals.end == TIME[-1]


@pytest.mark.parametrize("write", [version_5, hdf5], ids=["5", "7.3"])
def test_units_and_times_of_other_names(write, truck, tmp_path):
    units = {"nEng": "rpm", "t_ms": "ms"}
    write(tmp_path / "m.mat", {"d": {"t_ms": 1e3 * TIME, "nEng": SPEED / RPM, "units": units}})
    vehicle = replace(
        truck, columns={"time": TableColumn("t_ms"), "engine_speed": TableColumn("nEng")}
    )
    signals = read_log(tmp_path / "m.mat", vehicle)
    np.testing.assert_allclose(signals["engine_speed"].time, TIME, atol=1e-12)
    np.testing.assert_allclose(signals["engine_speed"].value, SPEED, rtol=1e-12)


def test_what_no_mat_file_holds_is_said(car, tmp_path):
    path = tmp_path / "m.mat"
    savemat(path, {"x": 1.0, "note": "text"})
    with pytest.raises(ClutchestError, match=r"m\.mat: no vectors of numbers \(.*x, note"):
        read_log(path, car)
    parts = {"a": {"time": TIME, "x": SPEED}, "b": {"time": SLOW, "y": WATER}}
    savemat(path, {**parts, "nEng": [1.0, 2.0]})
    with pytest.raises(ClutchestError, match="'nEng' has 2 samples and no times"):
        read_log(path, car)
    path.write_bytes(b"MATLAB 4, or whatever" * 30)
    with pytest.raises(ClutchestError, match=r"not a MAT file of version 5 to 7\.3"):
        read_log(path, car)


def element(kind: int, body: bytes) -> bytes:
    return struct.pack("<II", kind, len(body)) + body + bytes(-len(body) % 8)


def array(kind: int, shape: tuple[int, ...], rest: bytes = b"") -> bytes:
    flags, size = element(6, struct.pack("<II", kind, 0)), struct.pack(f"<{len(shape)}i", *shape)
    return element(14, flags + element(5, size) + element(1, b"x") + rest)


@pytest.mark.parametrize(
    "content",
    [
        array(2, (2**30, 1), element(5, struct.pack("<i", 8)) + element(1, b"")),
        array(1, (2**30, 1)),
        array(6, (2**30, 2**30)),
        element(15, zlib.compress(array(2, (2**31 - 1, 1)))),
        element(15, zlib.compress(bytes(300 << 20), 9)),
    ],
    ids=["struct array", "cells", "numbers", "compressed", "bomb"],
)
def test_a_small_file_that_claims_much_is_refused(content, car, tmp_path):
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    (tmp_path / "m.mat").write_bytes(head + content)
    with pytest.raises(ClutchestError, match=r"damaged, or nested|more than 256 MiB compressed"):
        read_log(tmp_path / "m.mat", car)


def tdms(path: Path, *channels: tuple[str, str, np.ndarray, dict[str, Any]]) -> Path:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject(*channel) for channel in channels])
    return path


def test_waveforms_have_times_of_their_own(car, tmp_path):
    start = np.datetime64("2024-01-18T09:30:00", "us")
    late = start + np.timedelta64(500, "ms")
    path = tdms(
        tmp_path / "m.tdms",
        ("fast", "nEng", SPEED / RPM, {"wf_increment": 0.01, "wf_start_time": start}),
        ("slow", "T_KMT", WATER, {"wf_increment": 0.1, "wf_start_time": late}),
        ("slow", "note", np.array(["a", "b"]), {}),
    )
    signals = read_log(path, car)
    assert signals.start_ns == start.astype("datetime64[ns]").astype(np.int64)
    np.testing.assert_allclose(signals["engine_speed"].time, TIME, atol=1e-12)
    np.testing.assert_allclose(signals["engine_speed"].value, SPEED, rtol=1e-12)
    np.testing.assert_allclose(signals["coolant_temp"].time, SLOW + 0.5, atol=1e-9)


def test_a_channel_of_times(truck, tmp_path):
    path = tdms(
        tmp_path / "measurement.dat",  # known by its first bytes
        ("m", "Zeit", 1e3 * TIME, {"unit_string": "ms"}),
        ("m", "engine_speed", SPEED / RPM, {"unit_string": "rpm"}),
    )
    signals = read_log(path, truck)
    np.testing.assert_allclose(signals["engine_speed"].time, TIME, atol=1e-12)
    np.testing.assert_allclose(signals["engine_speed"].value, SPEED, rtol=1e-12)


def test_a_name_in_two_groups_takes_the_groups_before_it(truck, tmp_path):
    path = tdms(
        tmp_path / "m.tdms",
        *((group, "t", TIME, {}) for group in ("left", "right")),
        ("left", "n", SPEED, {}),
        ("right", "n", 2.0 * SPEED, {}),
    )
    vehicle = replace(truck, columns={"engine_speed": TableColumn("right/n", "rad/s")})
    np.testing.assert_allclose(read_log(path, vehicle)["engine_speed"].value, 2.0 * SPEED)


def test_one_that_ends_early_is_read_up_to_there(truck, tmp_path):
    channels = [("m", "time", TIME, {}), ("m", "engine_speed", SPEED, {})]
    path = tdms(tmp_path / "m.tdms", *channels)
    path.write_bytes(path.read_bytes()[:-800])
    signals = read_log(path, truck)
    assert "m.tdms: the file ends early; what is there is used" in signals.warnings
    speed = signals["engine_speed"].only_valid()
    np.testing.assert_allclose(speed.value, SPEED[: len(speed)])
    assert 0 < len(speed) < N


def test_values_beyond_all_physics_are_not_used(truck, tmp_path):
    path = tmp_path / "m.csv"
    rows = [f"{t},{v}" for t, v in zip(TIME, [1e308, *SPEED[1:]], strict=True)]
    path.write_text("\n".join(["time,engine_speed", *rows]))
    signals = read_log(path, truck)
    assert signals.warnings == ("m.csv: column 'engine_speed': 1 values beyond 1e+30 are not used",)
    assert len(signals["engine_speed"].only_valid()) == N - 1


def test_a_damaged_one_is_refused_in_a_line(truck, tmp_path):
    (tmp_path / "m.tdms").write_bytes(b"TDSm" + bytes(range(200)))
    with pytest.raises(ClutchestError, match=r"m\.tdms: ") as caught:
        read_log(tmp_path / "m.tdms", truck)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", [8, 11, 19, 1033, 27263])
def test_elements_of_no_kind_are_refused(truck, tmp_path, kind):
    """scipy takes what stands beside its table of kinds for a type, and crashes."""
    path = tmp_path / "drive.mat"
    savemat(path, {"drive": {"time": TIME, "engine_speed": SPEED}})
    doubles, content = struct.pack("<II", 9, TIME.nbytes), path.read_bytes()
    assert content.count(doubles) == 2
    path.write_bytes(content.replace(doubles, struct.pack("<II", kind, TIME.nbytes), 1))
    with pytest.raises(ClutchestError, match=f"damaged, an element of kind {kind}"):
        read_log(path, truck)


def test_inspect_drafts_a_vehicle_of_them(tmp_path):
    savemat(tmp_path / "m.mat", {"time": TIME, "engine_speed": SPEED, "M": SPEED})
    found = inspect_tables([tmp_path / "m.mat"], "dry_clutch")
    assert {column.column for column in found.columns} == {"engine_speed", "M"}
    assert [each.column for each in found.candidates["engine_speed"]] == ["engine_speed"]
    console = Console(file=StringIO(), width=120)
    print_table_inspection(found, console)
    shown = console.file.getvalue().splitlines()
    assert any(line.count("engine_speed") == 2 for line in shown), "and what it could be"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig", "latin-1"])
@pytest.mark.parametrize("zipped", [False, True])
def test_texts_in_any_encoding(encoding, zipped, truck, tmp_path):
    rows = [f"{t:.2f};{v:.6f};85" for t, v in zip(TIME, SPEED / RPM, strict=True)]
    text = "\n".join(["time [s];engine_speed [rpm];coolant_temp [°C]", *rows])
    path = tmp_path / ("m.csv.gz" if zipped else "m.csv")
    content = text.encode(encoding)
    path.write_bytes(gzip.compress(content) if zipped else content)
    signals = read_log(path, truck)
    np.testing.assert_allclose(signals["engine_speed"].value, SPEED, rtol=1e-6)
    assert set(signals["coolant_temp"].value) == {85.0} and signals.warnings == ()


def test_compressed_data_that_end_early_are_refused(truck, tmp_path):
    rows = [f"{t:.2f},{v!r}" for t, v in zip(TIME.tolist(), SPEED.tolist(), strict=True)]
    content = gzip.compress("\n".join(["time,engine_speed", *rows]).encode())
    (tmp_path / "m.csv.gz").write_bytes(content[: len(content) // 2])
    with pytest.raises(ClutchestError, match=r"m\.csv\.gz: gzip data end early"):
        read_log(tmp_path / "m.csv.gz", truck)
