"""Faults of a bus, injected into the frames of a log, independently of their detection."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from clutchest.can.frames import Frames

EEC1, ETC1, ACTUATOR, COOLANT = 0x0CF00400, 0x0CF00203, 0x18FF1003, 0x18FEEE00
_GROUP = 0x00FFFF00


def rows(frames: Frames, can_id: int, begin: float, end: float) -> np.ndarray:
    """Rows of one message from ``begin`` to ``end`` s."""
    time = (frames.t_ns - frames.t_ns[0]) / 1e9
    same = (frames.id & _GROUP) == (can_id & _GROUP)
    return np.flatnonzero(same & (time >= begin) & (time < end))


def without(frames: Frames, can_id: int, begin: float, end: float) -> Frames:
    """No frame of the message in that time."""
    keep = np.ones(len(frames), bool)
    keep[rows(frames, can_id, begin, end)] = False
    return frames.take(keep)


def slowed(frames: Frames, can_id: int, begin: float, times: float) -> Frames:
    """From ``begin`` s on the message has so many ``times`` its period."""
    own = rows(frames, can_id, begin, np.inf)
    t_ns = frames.t_ns.copy()
    t_ns[own] = t_ns[own[0]] + ((t_ns[own] - t_ns[own[0]]) * times).astype(np.int64)
    last = frames.t_ns.max()
    late = replace(frames, t_ns=t_ns)
    return late.take(t_ns <= last).sorted()


def repeated(frames: Frames, can_id: int, begin: float, end: float, keep: slice) -> Frames:
    """The payload stays as it was, but for the bytes ``keep``."""
    own = rows(frames, can_id, begin, end)
    data = frames.data.copy()
    kept = data[own, keep].copy()
    data[own] = data[own[0]]
    data[own, keep] = kept
    return replace(frames, data=data)


def held(frames: Frames, can_id: int, begin: float, end: float, at: slice) -> Frames:
    """The bytes ``at`` stay as they were."""
    own = rows(frames, can_id, begin, end)
    data = frames.data.copy()
    data[own, at] = data[own[0], at]
    return replace(frames, data=data)


def flipped(
    frames: Frames, can_id: int, begin: float, end: float, byte: int, share: float, seed: int = 1
) -> Frames:
    """One bit of ``byte`` is wrong in that share of frames."""
    own = rows(frames, can_id, begin, end)
    own = own[np.random.default_rng(seed).random(len(own)) < share]
    data = frames.data.copy()
    data[own, byte] ^= 0x01
    return replace(frames, data=data)


def shaken(
    frames: Frames, can_id: int, begin: float, at: slice, steps: float, seed: int = 1
) -> Frames:
    """Noise of so many bus steps on the little-endian 16-bit number at ``at``."""
    own = rows(frames, can_id, begin, np.inf)
    data = frames.data.copy()
    raw = data[own, at].copy().view("<u2")[:, 0].astype(np.int64)
    raw += np.rint(np.random.default_rng(seed).normal(0.0, steps, len(own))).astype(np.int64)
    data[own, at] = np.maximum(raw, 0).astype("<u2")[:, None].view(np.uint8)
    return replace(frames, data=data)


def resummed(frames: Frames) -> Frames:
    """The actuator's checksums made right again: sum of payload and id bytes, folded."""
    own = rows(frames, ACTUATOR, 0.0, np.inf)
    data = frames.data.copy()
    data[own, 7] = 0
    total = data[own].astype(np.int64).sum(axis=1)
    ids = frames.id[own].astype(np.int64)
    total += sum((ids >> shift) & 0xFF for shift in (0, 8, 16, 24))
    data[own, 7] = (total + (total >> 8)) & 0xFF
    return replace(frames, data=data)
