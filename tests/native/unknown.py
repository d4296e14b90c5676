"""Functions that our compiler does not translate."""

from clutchest.native import compiled


@compiled
def sorts(a):
    """A call that it does not know."""
    return sorted(a)


@compiled
def lists(n):
    """A list."""
    return [n, n]


@compiled
def either(a, n):
    """A variable that is a number or an array."""
    value = 1.0
    if n > 0:
        value = a
    return value


@compiled
def endless(n):
    """A function that calls itself."""
    return endless(n)


@compiled
def outside(n):
    """Fails in what it calls."""
    return lists(n)
