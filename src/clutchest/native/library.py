"""Functions of numpy, written for this compiler."""

from clutchest.native.source import Source


def searchsorted(a, v):  # type: ignore[no-untyped-def]
    """``np.searchsorted(a, v)``: how many of the sorted ``a`` lie below v."""
    low, high = 0, len(a)
    while low < high:
        middle = (low + high) // 2
        if a[middle] < v:
            low = middle + 1
        else:
            high = middle
    return low


def searchsorted_right(a, v):  # type: ignore[no-untyped-def]
    """``np.searchsorted(a, v, side="right")``: how many of the sorted ``a`` lie at v or below."""
    low, high = 0, len(a)
    while low < high:
        middle = (low + high) // 2
        if a[middle] <= v:
            low = middle + 1
        else:
            high = middle
    return low


SOURCES = {f.__name__: Source(f) for f in (searchsorted, searchsorted_right)}
