"""Functions that have every construct of the language which our compiler translates."""

from __future__ import annotations

from math import ceil, exp, log
from typing import Any, NamedTuple

import numpy as np

from clutchest.native import compiled

TABLE = np.array([3.0, 1.0, 4.0, 1.0, 5.0])
COUNT, HALF = 5, 0.5
ALLOWED = (2, 3, 5)


class Pair(NamedTuple):
    """A record of an array and a number."""

    values: Any
    weight: Any


@compiled
def arithmetic(a, b):
    """Numbers of either type."""
    return a + b, a - b, a * b, a / b, -a, abs(a), min(a, b), max(a, b), a < b, a == b, a != b


@compiled
def whole(a, b):
    """Integers."""
    return a // b, a % b, a & b, a | b, a ^ b, ~a, a << 2, a >> 1, a**2.0, float(a), int(2.7 * b)


@compiled
def powers(a):
    """Of a float."""
    return a**2, a**3, a**4, a**0.5, a**-1.5, exp(a), log(abs(a)), ceil(a), np.floor(a), np.sqrt(a)


@compiled
def logic(a, b):
    """What stands behind is looked at only where it matters."""
    near = 0 < a <= b < 10
    inside = a < COUNT and TABLE[a] > HALF
    return near, inside, not near or inside, a in ALLOWED, a not in ALLOWED, 1 if a > b else 2.5


@compiled
def widened(n):
    """A number that begins as an integer and becomes a float within the loop."""
    total = 0
    for k in range(n):
        if k % 2:
            total += HALF
        else:
            total += 1
    return total, total > n


@compiled
def loops(n):
    """All kinds of loops."""
    down = up = steps = 0
    for k in range(n - 1, -1, -1):
        down = 10 * down + k
    for k in range(1, n, 2):
        up = 10 * up + k
        if up > 1000:
            break
    while True:
        steps += 1
        if steps % 3:
            continue
        if steps > n:
            break
    for last in (False, True):
        steps += 100 if last else 1000
    for i, value in enumerate(TABLE):
        steps += i * int(value)
    return down, up, steps, k


@compiled
def early(a):
    """Returns of several places and types."""
    if a < 0:
        return 0, -1.0
    for k in range(10):
        if k * k > a:
            return k, 0.5
    return 10, 1


@compiled
def elements(a, k):
    """Indices from both ends, parts, rows and columns of a matrix."""
    row, column = a[1], a[:, k]
    part = row[1:k]
    total = 0.0
    for value in part:
        total += value
    return a[k, 0], a[-1, -1], row[-2], column[-1], len(part), total, a.shape[0] * a.shape[1]


@compiled
def filled(a, flag, small, k):
    """What is written into arrays."""
    a[0, :] = 7
    a[1] = a[2]
    a[-1, 1:3] = 0.5
    a[2, 0] += 1
    a[0] = 4, 3.5, 2, k
    flag[1:] = True
    flag[0] |= a[0, 0] > 6
    small[0] = 300  # of which eight bits are kept
    small[1] += 1


@compiled
def fresh(a):
    """New arrays, and parts of them."""
    zeros, counts = np.zeros((2, len(a))), np.full(len(a), -1, np.int64)
    flags, same, like = np.zeros(len(a), np.bool_), a.copy(), np.empty_like(a)
    for k in range(len(a)):
        zeros[1, k], counts[k], flags[k], like[k] = a[k], k, a[k] > 1, 2 * a[k]
    same[0] = -1.0
    return zeros[1], counts[1:], flags, same, like[: len(a) - 1], zeros


@compiled
def swapped(a, b):
    """Arrays that take turns."""
    x, y = a, b
    for k in range(3):
        y[k] = x[k] + 1.0
        x, y = y, x
    return x[0], y[0], x[2], y[2]


@compiled
def weighed(pair: Pair, more: Any):
    """A record, handed on."""
    return scaled(pair.values, pair.weight) + scaled(more.values, more.weight)


@compiled(inline=True)
def scaled(values, weight):
    """A sum."""
    total = 0.0
    for value in values:
        total += weight * value
    return total


@compiled
def bytes_of(text, bits):
    """Small and unsigned integers."""
    count, value = 0, np.uint64(0)
    for char in text:
        count += char == 10
        value |= np.uint64(char) << np.uint64(bits)
    return (
        count,
        text[0] - 48,
        text[1] | 32,
        value,
        np.int64(value) >> np.int64(3),
        value >> bits_of(bits),
    )


@compiled
def bits_of(bits):
    """As unsigned."""
    return np.uint64(bits)


@compiled
def structure(rows, k):
    """An element of a structured array."""
    s = rows[k]
    s.count += 2
    s.level = s.level / 2 if s.count > 3 else -1.0
    return s.count, s.level, s.curve[1], s.curve[-1], len(s.curve)


@compiled
def sought(a, v):
    """Binary search."""
    return np.searchsorted(a, v), np.searchsorted(a, v, side="right")


@compiled
def of_record(row):
    """An element that is handed over by itself."""
    return row.count + row.level + row.curve[1]


@compiled
def doubled(n):
    """An unsigned number."""
    return n << np.uint64(1)


@compiled
def counted_down(i):
    """An argument that a loop takes for its own later on."""
    before = TABLE[i]
    for i in range(2):
        before += TABLE[i]
    return before


@compiled
def until_returned(n):
    """A loop that only a return leaves."""
    k = 0
    while True:
        k += n
        if k > 10:
            return k, n


@compiled(apart=True)
def rows_of_three(table, into):
    """Rows of a known length, and two arrays that share no memory."""
    assert table.shape[1] == into.shape[1] == 3
    for i in range(len(table)):
        for k in range(3):
            into[i, k] = table[i, k] + 2.0 * into[i, k]
