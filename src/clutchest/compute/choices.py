"""Comparisons and choices as functions: a call is compiled far faster than a conditional
expression, and both sides are known when it chooses, so that the machine code needs no jump.

Truth is 1.0 and 0.0, as CasADi has it.
"""

from math import atan, pi

from clutchest.native import compiled

# --- the generated module goes on from here ---


@compiled
def when(condition, value):
    """CasADi's ``if_else_zero``: a value that is not a number does no harm where not chosen."""
    return value if condition != 0.0 else 0.0


@compiled
def less(a, b):
    """a < b."""
    return 1.0 if a < b else 0.0


@compiled
def at_most(a, b):
    """a ≤ b."""
    return 1.0 if a <= b else 0.0


@compiled
def same(a, b):
    """a = b."""
    return 1.0 if a == b else 0.0


@compiled
def both(a, b):
    """a and b."""
    return 1.0 if a != 0.0 and b != 0.0 else 0.0


@compiled
def either(a, b):
    """a or b."""
    return 1.0 if a != 0.0 or b != 0.0 else 0.0


@compiled
def sign(a):
    """−1, 0 or 1."""
    return 1.0 if a > 0.0 else (-1.0 if a < 0.0 else 0.0)


@compiled
def angle(y, x):
    """Of a point in the plane, from −π to π."""
    if x > 0.0:
        return atan(y / x)
    if x < 0.0:
        return atan(y / x) + (pi if y >= 0.0 else -pi)
    return pi / 2.0 * sign(y)


@compiled
def smaller(a, b):
    """The smaller of two."""
    return a if a < b else b


@compiled
def larger(a, b):
    """The larger of two."""
    return a if a > b else b
