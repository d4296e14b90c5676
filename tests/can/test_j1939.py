from __future__ import annotations

import numpy as np
import pytest

from clutchest.can import j1939
from clutchest.signals import Why

OK, NA, ERROR, RESERVED = Why.VALID, Why.NOT_AVAILABLE, Why.ERROR, Why.RESERVED


@pytest.mark.parametrize(
    ("can_id", "pgn"),
    [
        (0x0CF00400, 61444),  # EEC1
        (0x18F004FE, 61444),
        (0x18FEF100, 65265),  # CCVS1
        (0x18FF1003, 65296),
        (0x0C000003, 0),  # TSC1 to the engine: the destination is not part of the group
        (0x0C00FF03, 0),
        (0x18EAFF00, 0xEA00),
        (0x19FEF100, 0x1FEF1),  # data page 1
    ],
)
def test_parameter_group(can_id, pgn):
    assert j1939.pgn(can_id) == pgn


@pytest.mark.parametrize(
    ("width", "codes"),
    [
        (1, {0: OK, 1: OK}),
        (2, {0: OK, 1: OK, 2: ERROR, 3: NA}),
        (3, {5: OK, 6: ERROR, 7: NA}),
        (4, {0xD: OK, 0xE: ERROR, 0xF: NA}),
        (8, {0xFA: OK, 0xFB: RESERVED, 0xFD: RESERVED, 0xFE: ERROR, 0xFF: NA}),
        (12, {0xFFD: OK, 0xFFE: ERROR, 0xFFF: NA}),
        (
            16,
            {
                0xFAFF: OK,
                0xFB00: RESERVED,
                0xFDFF: RESERVED,
                0xFE00: ERROR,
                0xFEFF: ERROR,
                0xFF00: NA,
                0xFFFF: NA,
            },
        ),
        (
            32,
            {
                0xFAFFFFFF: OK,
                0xFB000000: RESERVED,
                0xFE000000: ERROR,
                0xFEFFFFFF: ERROR,
                0xFF000000: NA,
                0xFFFFFFFF: NA,
            },
        ),
        (64, {2**64 - 3: OK, 2**64 - 2: ERROR, 2**64 - 1: NA}),
    ],
)
def test_code_ranges(width, codes):
    why = j1939.why_of(np.array(list(codes), np.uint64), width)
    assert why.tolist() == list(codes.values())


def test_parameters_with_ranges_of_their_own():
    nibbles = np.arange(16, dtype=np.uint64)
    assert j1939.why_of(nibbles, 4, spn=4154).tolist() == [OK] * 8 + [NA] * 8
    assert j1939.why_of(nibbles, 4, spn=899).tolist() == [OK] * 15 + [NA]
    gears = np.array([0xFA, 0xFB, 0xFC, 0xFE, 0xFF], np.uint64)
    assert j1939.why_of(gears, 8, spn=523).tolist() == [OK, OK, RESERVED, ERROR, NA]
