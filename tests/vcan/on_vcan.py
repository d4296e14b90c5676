"""Monitors on vcan0, with kernel stamps, real pace and foreign traffic; see test_vcan.py."""

import json
import multiprocessing
import socket
import struct
import time

import numpy as np
import pandas as pd
import pytest

import can
import clutchest
from clutchest.can.bus import SocketReader, filters, open_bus
from clutchest.can.files import read_frames, write_frames
from clutchest.can.player import play
from clutchest.can.readers import reader_of
from clutchest.reading.log import load_database
from clutchest.reading.wanted import mapped_messages
from clutchest.shipped import locate
from vcan import machine_boot

pytestmark = pytest.mark.vcan
BUS = "vcan0"
FORK = multiprocessing.get_context("fork")  # what is imported already is there at once


@pytest.fixture(scope="module")
def truck():
    return clutchest.load_vehicle("truck")


@pytest.fixture
def drive(tmp_path, truck):
    """``drive(a, b)``: a piece of the shipped log as a file, and how many frames are mapped."""
    frames = read_frames(locate("demo", "logs"))
    t = (frames.t_ns - frames.t_ns[0]) / 1e9
    database = load_database(truck)
    wanted = [database.message(name) for name in mapped_messages(truck, database)]

    def piece(a, b):
        part = frames.take((t >= a) & (t < b))
        path = tmp_path / f"{a}-{b}.log"
        write_frames(part, path)
        mapped = np.zeros(len(part), bool)
        for message in wanted:
            mapped |= (part.id & message.id_mask) == (message.id & message.id_mask)
        return path, int(mapped.sum())

    return piece


def sending(path):
    def send():
        bus = open_bus("socketcan", BUS)
        play(path, bus)
        bus.shutdown()

    process = FORK.Process(target=send, daemon=True)
    process.start()
    return process


def chatter(rate):
    """Frames that nobody asked for, ``rate`` a second."""

    def send():
        sock = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        sock.bind((BUS,))
        begin, sent = time.monotonic(), 0
        while True:
            while sent < rate * (time.monotonic() - begin):
                sock.send(struct.pack("=IB3x8s", 0x100 + sent % 0x300, 8, b"chatter!"))
                sent += 1
            time.sleep(0.005)

    process = FORK.Process(target=send, daemon=True)
    process.start()
    return process


def monitor(truck, out):
    return clutchest.Monitor(open_bus("socketcan", BUS), truck, out=out)


def events_of(out):
    return [json.loads(line) for line in (out / "events.jsonl").open()]


def assert_like_a_replay(out, truck):
    estimates = pd.read_parquet(out / "estimates.parquet")
    whole = clutchest.replay(clutchest.read_log(out / "received.log", truck), truck).to_pandas()
    assert len(estimates) >= len(whole) > 50  # a silence at the end gives rows, but no frame
    estimates = estimates.iloc[: len(whole)]
    assert np.array_equal(estimates["time"], whole["time"])
    assert (estimates["mode"].astype(str) == whole["mode"].astype(str)).all()
    for name in estimates.columns:
        if f"{name}_std" in estimates.columns:
            a, b, std = estimates[name], whole[name], whole[f"{name}_std"]
            assert (np.abs(a - b) <= 1e-9 * np.maximum(np.abs(b), std)).all(), name
    return estimates


def test_nothing_is_lost_beside_foreign_traffic(tmp_path, drive, truck):
    path, mapped = drive(4.0, 17.0)
    watching = monitor(truck, tmp_path / "out")
    noise, sender = chatter(2000), sending(path)

    def show(status, piece, events):
        if status.frames >= mapped:
            watching.stop()

    status = watching.run(150.0, show)
    noise.kill()
    sender.join(10)
    assert status.frames == mapped and status.lost == 0
    received = read_frames(tmp_path / "out/received.log")
    assert len(received) == mapped, "foreign frames stay outside"
    assert_like_a_replay(tmp_path / "out", truck)
    assert any(e["kind"] == "engagement" for e in events_of(tmp_path / "out"))


def test_the_interface_goes_and_comes_back(tmp_path, drive, truck):
    first, _ = drive(5.0, 12.5)
    then, _ = drive(40.0, 44.0)
    watching = monitor(truck, tmp_path / "out")

    def happenings():
        sending(first).join()
        machine_boot.switch(BUS, False)
        time.sleep(1.0)
        machine_boot.switch(BUS, True)
        time.sleep(10.5)
        sending(then).join()

    import threading

    story = threading.Thread(target=happenings, daemon=True)
    story.start()

    def show(status, piece, events):
        if not story.is_alive():
            watching.stop()

    watching.run(120.0, show)
    events = events_of(tmp_path / "out")
    told = [(e["kind"], e["name"]) for e in events]
    assert ("reconnect", "bus") in told
    assert any(kind == "warning" and "interface failed" in name for kind, name in told)
    silences = [e["data"] for e in events if (e["kind"], e["name"]) == ("gap", "bus")]
    assert [s["over"] for s in silences[:2]] == [False, True]
    assert silences[1]["duration_s"] > 11.0
    estimates = assert_like_a_replay(tmp_path / "out", truck)
    silent = silences[0]["since_s"]
    inside = estimates[(estimates["time"] > silent + 0.5) & (estimates["time"] < silent + 10.5)]
    assert set(inside["mode"].astype(str)) == {"unknown"}, "nobody knows what the clutch did"


def test_what_a_full_buffer_drops_is_counted():
    reader = reader_of(open_bus("socketcan", BUS))
    assert isinstance(reader, SocketReader)
    reader.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 20_000)
    sender = open_bus("socketcan", BUS)

    def send(number):
        sender.send(
            can.Message(arbitration_id=0x123, data=number.to_bytes(4, "big"), is_extended_id=False)
        )

    for k in range(500):
        send(k)
    got = 0
    while (received := reader.read(0.2)) is not None:
        got += len(received.frames)
    send(500)
    received = reader.read(1.0)
    assert received is not None
    assert 0 < got < 500
    assert got + received.dropped == 500
    sender.shutdown()
    reader.bus.shutdown()


def test_stamps_are_those_of_the_kernel():
    reader, sender = reader_of(open_bus("socketcan", BUS)), open_bus("socketcan", BUS)
    before = time.time_ns()
    sender.send(can.Message(arbitration_id=0x123, is_extended_id=False))
    after = time.time_ns()
    time.sleep(0.3)
    received = reader.read(1.0)
    assert received is not None
    assert before - 10_000_000 <= received.frames.t_ns[0] <= after + 100_000_000
    sender.shutdown()
    reader.bus.shutdown()


def test_only_what_is_mapped_comes_in(truck):
    database = load_database(truck)
    messages = [database.message(name) for name in mapped_messages(truck, database)]
    bus, sender = open_bus("socketcan", BUS, messages), open_bus("socketcan", BUS)
    wanted = filters(messages)
    for rule in wanted:
        sender.send(can.Message(arbitration_id=rule["can_id"] | 0x42, is_extended_id=True))
        sender.send(can.Message(arbitration_id=rule["can_id"] & 0x7FF, is_extended_id=False))
    sender.send(can.Message(arbitration_id=0x18FEF6FF, is_extended_id=True))
    reader, ids = reader_of(bus), []
    while (received := reader.read(0.2)) is not None:
        ids += received.frames.id.tolist()
    assert sorted(ids) == sorted(rule["can_id"] | 0x42 for rule in wanted)
    sender.shutdown()
    bus.shutdown()
