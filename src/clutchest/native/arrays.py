"""Elements and parts of arrays: addresses, slices, loops over all elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from clutchest.native.arithmetic import converted
from clutchest.native.types import BOOL, ELEMENTS, INT, Array, Struct, Unsupported
from clutchest.native.writer import Value, Writer, number


@dataclass(frozen=True, slots=True)
class Slice:
    """``start:stop`` of an index, None where left out."""

    start: Value | None
    stop: Value | None


Index = Value | Slice


def shape(array: Value) -> list[str]:
    """The operands of an array's shape."""
    assert isinstance(array.type, Array)
    return list(array.leaves[1 : 1 + array.type.ndim])


def strides(w: Writer, array: Value) -> list[str]:
    """The operands of an array's strides, in bytes."""
    assert isinstance(array.type, Array)
    ndim = array.type.ndim
    if not array.type.packed:
        return list(array.leaves[1 + ndim :])
    steps = [str(array.type.size)]
    for length in reversed(shape(array)[1:]):
        steps.insert(0, _times(w, length, steps[0]))
    return steps


def unpacked(w: Writer, array: Value) -> Value:
    """The same array with its strides."""
    assert isinstance(array.type, Array)
    of = Array(array.type.dtype, array.type.ndim, False)
    return Value(of, (array.leaves[0], *shape(array), *strides(w, array)))


def length(array: Value) -> Value:
    """``len(array)``."""
    [first, *_] = shape(array)
    if first.isdigit():
        return number(int(first))
    return Value(INT, (first,), natural=True)


def element(w: Writer, array: Value, indices: list[Index]) -> Value:
    """``array[indices]``: a number, or an array that shares the memory."""
    assert isinstance(array.type, Array)
    if len(indices) < array.type.ndim or any(isinstance(index, Slice) for index in indices):
        return _part(w, array, indices)
    return _read(w, array.type.dtype, _address(w, array, indices))


def store(w: Writer, array: Value, indices: list[Index], value: Value) -> None:
    """``array[indices] = value``; a number fills whatever is chosen."""
    assert isinstance(array.type, Array)
    if len(indices) < array.type.ndim or any(isinstance(index, Slice) for index in indices):
        part, dtype = _part(w, array, indices), array.type.dtype
        if isinstance(value.type, Array):
            assert isinstance(part.type, Array)
            if value.type.ndim != part.type.ndim:
                raise Unsupported("an array into one of more dimensions")
            source = value.type.dtype

            def copied(at: str, places: list[Index]) -> None:
                _write(w, dtype, at, _read(w, source, _address(w, value, places)))

            each(w, part, copied)
        else:
            each(w, part, lambda at, _: _write(w, dtype, at, value))
        return
    _write(w, array.type.dtype, _address(w, array, indices), value)


def field(w: Writer, struct: Value, name: str) -> Value:
    """A field of a structured array's element."""
    dtype, address, sizes = _field(w, struct, name)
    if sizes:
        return Value(Array(dtype, len(sizes), True), (address, *map(str, sizes)))
    return _read(w, dtype, address)


def store_field(w: Writer, struct: Value, name: str, value: Value) -> None:
    """Change a field of a structured array's element."""
    dtype, address, sizes = _field(w, struct, name)
    if sizes:
        raise Unsupported(f"field '{name}' is set, which is an array")
    _write(w, dtype, address, value)


def _field(w: Writer, struct: Value, name: str) -> tuple[str, str, tuple[int, ...]]:
    assert isinstance(struct.type, Struct)
    for known, dtype, offset, sizes in struct.type.fields:
        if known == name:
            at = w.new(f"getelementptr i8, ptr {struct.leaves[0]}, i64 {offset}")
            return dtype, at, sizes
    raise Unsupported(f"no field '{name}'")


def _read(w: Writer, dtype: str | Struct, address: str) -> Value:
    if isinstance(dtype, Struct):
        return Value(dtype, (address,))
    of = ELEMENTS[dtype]
    value = w.new(f"load {of.stored}, ptr {address}")
    if of.type == BOOL:
        return Value(BOOL, (w.new(f"icmp ne i8 {value}, 0"),))
    if of.widen:
        value = w.new(f"{of.widen} {of.stored} {value} to {of.type.leaves[0]}")
    return Value(of.type, (value,), natural=of.widen == "zext")


def _write(w: Writer, dtype: str | Struct, address: str, value: Value) -> None:
    if isinstance(dtype, Struct):
        raise Unsupported("a structure is set as a whole")
    of = ELEMENTS[dtype]
    [operand] = converted(w, value, of.type).leaves
    if of.narrow:
        operand = w.new(f"{of.narrow} {of.type.leaves[0]} {operand} to {of.stored}")
    w.line(f"store {of.stored} {operand}, ptr {address}")


def _address(w: Writer, array: Value, indices: list[Index]) -> str:
    """Where an element lies."""
    assert isinstance(array.type, Array)
    data, sizes = array.leaves[0], shape(array)
    places = [_from_begin(w, index, size) for index, size in zip(indices, sizes, strict=True)]
    if array.type.packed:
        flat = places[0]
        for place, size in zip(places[1:], sizes[1:], strict=True):
            flat = _plus(w, _times(w, flat, size), place)
        return w.new(
            f"getelementptr inbounds {array.type.stored}, ptr {array.leaves[0]}, i64 {flat}"
        )
    offset = "0"
    for place, step in zip(places, strides(w, array), strict=True):
        offset = _plus(w, offset, _times(w, place, step))
    return w.new(f"getelementptr inbounds i8, ptr {data}, i64 {offset}")


def _part(w: Writer, array: Value, indices: list[Index]) -> Value:
    """The array that ``indices`` leave of one."""
    assert isinstance(array.type, Array)
    chosen = [*indices, *(Slice(None, None),) * (array.type.ndim - len(indices))]
    offset, sizes, steps = "0", [], []
    for index, size, step in zip(chosen, shape(array), strides(w, array), strict=True):
        if isinstance(index, Slice):
            start = "0" if index.start is None else _bound(w, index.start, size)
            stop = size if index.stop is None else _bound(w, index.stop, size)
            sizes.append(size if start == "0" and stop == size else _between(w, start, stop))
            steps.append(step)
        else:
            start = _from_begin(w, index, size)
        offset = _plus(w, offset, _times(w, start, step))
    data = array.leaves[0]
    if offset != "0":
        data = w.new(f"getelementptr inbounds i8, ptr {data}, i64 {offset}")
    first = next(i for i, index in enumerate(chosen) if isinstance(index, Slice))
    whole = all(
        isinstance(i, Slice) and i.start is None and i.stop is None for i in chosen[first + 1 :]
    )
    packed = array.type.packed and whole
    of = Array(array.type.dtype, len(sizes), packed)
    return Value(of, (data, *sizes) if packed else (data, *sizes, *steps))


def _from_begin(w: Writer, index: Index, size: str) -> str:
    """An index, a negative one from the end."""
    assert isinstance(index, Value)
    if index.type not in (INT, BOOL):
        raise Unsupported(f"an index that is {index.type}")
    [place] = converted(w, index, INT).leaves
    if index.natural:
        return place
    if index.is_constant:
        return w.new(f"add i64 {size}, {place}")
    behind, below = w.new(f"add i64 {size}, {place}"), w.new(f"icmp slt i64 {place}, 0")
    return w.new(f"select i1 {below}, i64 {behind}, i64 {place}")


def _bound(w: Writer, index: Value, size: str) -> str:
    """A bound of a slice, within the array."""
    place = _from_begin(w, index, size)
    above = w.new(f"icmp sgt i64 {place}, {size}")
    place = w.new(f"select i1 {above}, i64 {size}, i64 {place}")
    if index.natural:
        return place
    below = w.new(f"icmp slt i64 {place}, 0")
    return w.new(f"select i1 {below}, i64 0, i64 {place}")


def _between(w: Writer, start: str, stop: str) -> str:
    if start == "0":
        return stop
    count = w.new(f"sub i64 {stop}, {start}")
    below = w.new(f"icmp slt i64 {count}, 0")
    return w.new(f"select i1 {below}, i64 0, i64 {count}")


def _times(w: Writer, a: str, b: str) -> str:
    if a.isdigit() and b.isdigit():
        return str(int(a) * int(b))
    if "1" in (a, b):
        return b if a == "1" else a
    return w.new(f"mul i64 {a}, {b}")


def _plus(w: Writer, a: str, b: str) -> str:
    if a.isdigit() and b.isdigit():
        return str(int(a) + int(b))
    if "0" in (a, b):
        return b if a == "0" else a
    return w.new(f"add i64 {a}, {b}")


def counted(w: Writer, start: str, stop: str, step: int, body: Callable[[str], str]) -> None:
    """A loop over integers; ``body`` is given one, and gives the label at which the loop goes on,
    which it has not begun."""
    [counter] = w.memory(INT)
    head, inside, end = w.label(), w.label(), w.label()
    w.line(f"store i64 {start}, ptr {counter}")
    w.jump(head)
    w.begin(head)
    i = w.new(f"load i64, ptr {counter}")
    w.branch(w.new(f"icmp {'slt' if step > 0 else 'sgt'} i64 {i}, {stop}"), inside, end)
    w.begin(inside)
    on = body(i)
    w.jump(on)
    w.begin(on)
    w.line(f"store i64 {w.new(f'add i64 {i}, {step}')}, ptr {counter}")
    w.jump(head)
    w.begin(end)


def each(w: Writer, array: Value, action: Callable[[str, list[Index]], None]) -> None:
    """Do something for the address and the indices of every element."""
    sizes = shape(array)

    def deeper(places: list[Index]) -> None:
        if len(places) == len(sizes):
            action(_address(w, array, places), places)
            return

        def body(i: str) -> str:
            deeper([*places, Value(INT, (i,), natural=True)])
            return w.label()

        counted(w, "0", sizes[len(places)], 1, body)

    deeper([])
