"""Compiled readers of the cells of a table of frames: ids, payloads, words that set a flag."""

from __future__ import annotations

from clutchest.can.csv_header import (
    IS_EXTENDED,
    IS_FAST,
    IS_FD,
    IS_PASSIVE,
    IS_REMOTE,
    IS_SENT,
    KIND,
)
from clutchest.can.frames import LENGTHS
from clutchest.can.text_scan import (
    BAD_DATA,
    BRS,
    ERROR,
    ESI,
    EXTENDED,
    FD,
    HEX,
    REMOTE,
    SENT,
    WIDE,
    Bytes,
    Table,
    blanks,
    compiled,
    decimal,
    hexadecimal,
)


@compiled
def is_letter(char: int, small: int) -> bool:
    """Whether it is this letter, in upper or lower case."""
    return bool((char | 32) == small)


@compiled
def cell_ends(text: Bytes, i: int, separator: int) -> bool:
    """Whether a cell ends here, blanks aside."""
    i = blanks(text, i) if separator != 9 or text[i] != 9 else i
    return bool(text[i] == separator or text[i] <= 32 or text[i] == 34)


@compiled
def field_end(text: Bytes, i: int, separator: int, quoted: bool) -> int:
    """The separator or newline behind a field."""
    while text[i] != 10 and (quoted or text[i] != separator):
        quoted = quoted and text[i] != 34
        i += 1
    return i


@compiled
def identifier(
    text: Bytes, i: int, separator: int, is_decimal: bool, n: int, out: Table
) -> tuple[int, int]:
    """(position behind, flags) of an id, hexadecimal unless ``is_decimal``, with or without 0x,
    an x or h behind it; a negative position where it is none."""
    if is_letter(text[i], 101) and is_letter(text[i + 1], 114):  # Error
        return i, ERROR
    marked = text[i] == 48 and is_letter(text[i + 1], 120)  # 0x
    first = i + 2 if marked else i + (text[i] == 36)  # $
    if is_decimal and not marked:
        value, behind = decimal(text, first)
    else:
        value, behind = hexadecimal(text, first)
    wide = is_letter(text[behind], 120)
    end = behind + (wide or is_letter(text[behind], 104))
    if behind == first or value > 0x1FFFFFFF or not cell_ends(text, end, separator):
        return -1, 0
    out.id[n] = value
    return end, (EXTENDED if wide or value > 0x7FF else 0)


@compiled
def channel_number(text: Bytes, i: int, separator: int) -> int:
    """The first number in a field."""
    while text[i] != 10 and text[i] != separator:
        if 48 <= text[i] <= 57:
            value, _ = decimal(text, i)
            return value
        i += 1
    return 0


@compiled
def flags_of_kvaser(bits: int) -> int:
    """Flags of the bits that Kvaser's CANlib gives a message."""
    flag = (EXTENDED if bits & 4 else 0) | (REMOTE if bits & 1 else 0) | (ERROR if bits & 32 else 0)
    flag |= (SENT if bits & 192 else 0) | (FD if bits & 0x10000 else 0)
    return flag | (BRS if bits & 0x20000 else 0) | (ESI if bits & 0x40000 else 0)


@compiled
def flags_of(role: int, text: Bytes, i: int) -> int:
    """The flag that a column of yes or no, or of a kind of frame, sets by its cell at ``i``."""
    first, second = text[i] | 32, text[i + (text[i] != 10)] | 32
    yes = first == 116 or first == 121 or (text[i] == 49 and second != 49)  # t, y, 1
    if role == IS_EXTENDED:  # also x, ext, 29
        yes = yes or first == 120 or first == 101 or (text[i] == 50 and second == 57)
        return EXTENDED if yes else 0
    if role == IS_SENT:  # also sent, out
        return SENT if yes or first == 115 or first == 111 else 0
    if role == KIND:
        return _flags_of_kind(text, i, first, second)
    if not yes:
        return 0
    if role == IS_REMOTE:
        return REMOTE
    if role == IS_FD:
        return FD
    if role == IS_FAST:
        return BRS
    return ESI if role == IS_PASSIVE else ERROR


@compiled
def _flags_of_kind(text: Bytes, i: int, first: int, second: int) -> int:
    """The flag of a word: ext, x; rtr, rr, remote, but not received; tx, transmit; error; fd."""
    if first == 114:  # r
        remote = second == 116 or second == 114
        return REMOTE if remote or (second == 101 and is_letter(text[i + 2], 109)) else 0
    if first == 116 and (second == 120 or second == 114):
        return SENT
    if first == 102 and (second == 98 or 100 <= second <= 101):  # fd, fb, fe
        return FD
    if first == 101 and second == 114:
        return ERROR
    return EXTENDED if first == 120 or (first == 101 and second == 120) else 0


@compiled
def frame_length(stated: int, count: int, flag: int) -> int:
    """Payload bytes, of what is stated and how many there are: beyond 8 a code may be stated."""
    if stated < 0:
        return count
    if 8 < stated < 16 and LENGTHS[stated] == count:
        return count
    return stated


@compiled
def payload(
    text: Bytes, i: int, count: int, many: bool, commas: bool, n: int, out: Table
) -> tuple[int, int]:
    """(bytes so far, position behind) of one hexadecimal byte or, where there are ``many``, of a
    field of them, with or without something between them, with ``commas`` these too; a negative
    number is the reason why not."""
    joined = False  # to the byte before
    while True:
        while many and (
            text[i] == 32 or 45 <= text[i] <= 46 or text[i] == 58 or (commas and text[i] == 44)
        ):  # -.:,
            i, joined = i + 1, False
        if text[i] == 48 and (text[i + 1] | 32) == 120:  # 0x
            i += 2
        high = HEX[text[i]]
        if high < 0:
            return count, i
        low = HEX[text[i + 1]]
        if count == 64 or (joined and low < 0):
            return BAD_DATA, i
        if count == out.data.shape[1]:
            return WIDE, i
        out.data[n, count] = high if low < 0 else high * 16 + low
        count, i, joined = count + 1, i + (1 if low < 0 else 2), True
        if not many:
            return count, i


@compiled
def decimal_payload(
    text: Bytes, i: int, count: int, many: bool, commas: bool, n: int, out: Table
) -> tuple[int, int]:
    """As :func:`payload`, of decimal numbers."""
    while True:
        while many and (text[i] == 32 or (commas and text[i] == 44)):
            i += 1
        value, behind = decimal(text, i)
        if behind == i:
            return count, i + (many and text[i] == 93)  # ]
        if value > 255 or count == 64:
            return BAD_DATA, i
        if count == out.data.shape[1]:
            return WIDE, i
        out.data[n, count] = value
        count, i = count + 1, behind
        if not many:
            return count, i
