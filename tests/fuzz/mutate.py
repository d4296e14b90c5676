"""Damage to files: what a broken disk, a hurried editor or an enemy would do."""

from __future__ import annotations

import gzip
import struct
import zlib
from copy import deepcopy
from io import BytesIO
from random import Random
from xml.etree import ElementTree
from zipfile import ZipFile

# Pieces that mean something to some reader, and numbers at the edges.
WORDS = [
    b"\n",
    b"\r\n",
    b" ",
    b"\t",
    b"\0",
    b"\xff",
    b"-",
    b".",
    b",",
    b";",
    b"(",
    b")",
    b"[",
    b"]",
    b"#",
    b"##",
    b"R",
    b"x",
    b"0",
    b"1",
    b"8",
    b"15",
    b"64",
    b"65",
    b"255",
    b"9999999999999999999",
    b"1e-05",
    b"1e308",
    b"0x",
    b"FFFFFFFF",
    b"1FFFFFFF",
    b"7FF",
    b"800",
    b"20000080",
    b"ErrorFrame",
    b"CANFD",
    b"Rx",
    b"Tx",
    b"d ",
    b"r ",
    b"RTR",
    b"DT",
    b"FD",
    b"FB",
    b"RR",
    b"Begin Triggerblock ",
    b"date Mon Nov 20 10:13:20.250 am 2023\n",
    b"base dec timestamps relative\n",
    b";$COLUMNS=N,O,D",
    b";$FILEVERSION=2.1\n",
    b";$STARTTIME=99999999\n",
    b"LOBJ",
    b"LOGG",
    b"==",
    b"remote request",
]
NUMBERS = (
    0,
    1,
    7,
    8,
    9,
    15,
    16,
    17,
    31,
    32,
    40,
    64,
    65,
    127,
    128,
    255,
    0x7FFF,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
)


def mutated(content: bytes, others: list[bytes], random: Random) -> bytes:
    """``content`` with one to eight kinds of damage, shorter than 64 KiB."""
    data = bytearray(content)
    for _ in range(1 << random.randrange(4)):
        at = random.randrange(len(data) + 1)
        length = min(1 << random.randrange(8), len(data) - at)
        kind = random.randrange(10)
        if kind == 0 and at < len(data):
            data[at] ^= 1 << random.randrange(8)
        elif kind == 1 and at < len(data):
            data[at] = random.randrange(256)
        elif kind == 2:
            del data[at : at + length]
        elif kind == 3:
            data[at:at] = data[at : at + length]
        elif kind == 4:
            data[at:at] = random.choice(WORDS)
        elif kind == 5:
            word = random.choice(WORDS)
            data[at : at + len(word)] = word
        elif kind == 6:
            size = random.choice("BHIQ")
            number = random.choice(NUMBERS) & (1 << 8 * struct.calcsize(size)) - 1
            data[at : at + struct.calcsize(size)] = struct.pack("<" + size, number)
        elif kind == 7:
            del data[at:]
        elif kind == 8:
            other = random.choice(others)
            start = random.randrange(len(other) + 1)
            data[at:at] = other[start : start + 4 * length]
        elif kind == 9:
            data[at:at] = data[at : at + length] * random.randrange(40)
    return bytes(data[: 1 << 16])


def packed(content: bytes, random: Random) -> bytes:
    """The damaged objects of a blf file in a sound container, so that they are looked at."""
    at = content.find(b"LOBJ")
    if at < 0 or random.random() < 0.3:
        return content
    inner = zlib.compress(content[at:], 1)
    size = 32 + len(inner)
    head = struct.pack("<4s2H2LH6xL4x", b"LOBJ", 16, 1, size, 10, 2, random.choice(NUMBERS))
    return content[:at] + head + inner + bytes(size % 4)


def zipped(content: bytes, random: Random) -> bytes:
    """Gzipped, and now and then damaged after that."""
    whole = gzip.compress(content, 1)
    return mutated(whole, [whole], random) if random.random() < 0.5 else whole


def stored(archive: bytes) -> bytes:
    """A zip archive again, without compression, so that damage stays where it is."""
    with ZipFile(BytesIO(archive)) as held:
        return _archive({name: held.read(name) for name in held.namelist()})


def _archive(members: dict[str, bytes]) -> bytes:
    content = BytesIO()
    with ZipFile(content, "w") as whole:
        for name, member in members.items():
            whole.writestr(name, member)
    return content.getvalue()


def member_damaged(archive: bytes, others: list[bytes], random: Random) -> bytes:
    """A sound zip archive, one of whose members is damaged."""
    with ZipFile(BytesIO(archive)) as held:
        members = {name: held.read(name) for name in held.namelist()}
    name = random.choice(list(members))
    members[name] = mutated(members[name], others, random)
    return _archive(members)


def tree_damaged(content: bytes, random: Random) -> bytes:
    """A sound XML file, some of whose elements are wrong, moved or missing."""
    root = ElementTree.fromstring(content)
    for _ in range(1 << random.randrange(4)):
        every = list(root.iter())
        one, other = random.choice(every), random.choice(every)
        kind = random.randrange(6)
        if kind == 0:
            one.text = other.text
        elif kind == 1:
            one.text = str(random.choice(NUMBERS))
        elif kind == 2:
            one.text = random.choice(WORDS).decode("latin-1")
        elif kind == 3 and len(one):
            one.remove(random.choice(list(one)))
        elif kind == 4:
            one.insert(random.randrange(len(one) + 1), deepcopy(other))
        elif kind == 5 and other.attrib:
            name = random.choice(list(other.attrib))
            other.set(name, random.choice([str(random.choice(NUMBERS)), one.text or ""]))
    return ElementTree.tostring(root)[: 1 << 16]
