"""Units as the loggers of rigs write them."""

from __future__ import annotations

import pytest

from clutchest.reading.table_columns import split_header


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("p_Bremse [bar]", "p_Bremse", "bar"),
        ("Q (l/min)", "Q", "l/min"),
        ("V [l]", "V", "l"),
        ("wheel speed (L)", "wheel speed (L)", ""),  # the left one
        ("wheel speed (l)", "wheel speed (l)", ""),
    ],
)
def test_litres_are_not_what_is_on_the_left(header, name, unit):
    assert split_header(header) == (name, unit)
