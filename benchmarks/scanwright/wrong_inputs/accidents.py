"""What becomes of a valid file, or of a number on the command line, by accident or by malice."""

from __future__ import annotations

import random
import re
import shutil
from pathlib import Path

import numpy as np

_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORDS = [
    *(
        b"NaN",
        b"nan",
        b"inf",
        b"-inf",
        b"1e300",
        b"-1e300",
        b"1e999",
        b"0",
        b"-1",
        b"1e-300",
        b"true",
        b"null",
        b'"90"',
    ),
    *(b"[]", b"{}", b"abc", b"", b"99999999999999999999", b"1" + b"0" * 400, b"0x10", b"1,5", b"\xc3\xa9", b"5e-324"),
]
_TEXT = {".toml", ".json", ".csv", ".tum", ".xyz"}


def number(rng: random.Random) -> str:
    """What somebody may write for a number."""
    return rng.choice(_WORDS).decode()


def damage(rng: random.Random, path: Path, others: list[Path]) -> str:
    """Damage a file in place; what was done, in words."""
    ways = [_flip, _cut, _run, _kind]
    if path.suffix == ".npz":
        ways += [_arrays] * 4
    ways += [_token, _lines] * 3 if path.suffix in _TEXT else [_head] * 3
    way = rng.choice(ways)
    return way(rng, path, others)


def _flip(rng: random.Random, path: Path, _others: list[Path]) -> str:
    data = bytearray(path.read_bytes())
    places = [rng.randrange(len(data)) for _ in range(rng.choice([1, 1, 4, 64]))]
    for place in places:
        data[place] ^= 1 << rng.randrange(8)
    path.write_bytes(data)
    return f"{len(places)} bits flipped, the first in byte {places[0]}"


def _cut(rng: random.Random, path: Path, _others: list[Path]) -> str:
    data = path.read_bytes()
    size = rng.choice([0, 1, rng.randrange(len(data)), len(data) - 1])
    path.write_bytes(data[:size])
    return f"cut to {size} bytes"


def _run(rng: random.Random, path: Path, _others: list[Path]) -> str:
    data = path.read_bytes()
    at, size = rng.randrange(len(data)), rng.choice([1, 4, 8, 100])
    new = rng.choice([b"", b"\0" * size, b"\xff" * size, rng.randbytes(size), data[at : at + size] * 2])
    path.write_bytes(data[:at] + new + data[at + size :])
    return f"{size} bytes at {at} became {new[:16]!r}"


def _head(rng: random.Random, path: Path, _others: list[Path]) -> str:
    """Numbers in the first bytes: lengths, counts, offsets, types."""
    data = path.read_bytes()
    head = data[: rng.choice([64, 400])]
    words = list(_NUMBER.finditer(head))
    if words and rng.random() < 0.6:
        word = rng.choice(words)
        new = rng.choice(_WORDS)
        path.write_bytes(data[: word.start()] + new + data[word.end() :])
        return f"{word.group()!r} in the head became {new[:24]!r}"
    at = rng.randrange(len(head))
    new = rng.choice([b"\xff" * 8, b"\0" * 8, b"\xff\xff\xff\x7f", rng.randbytes(2), b"\0\0\0\0\0\0\xf8\x7f"])
    path.write_bytes(data[:at] + new + data[at + len(new) :])
    return f"bytes at {at} of the head became {new!r}"


def _token(rng: random.Random, path: Path, _others: list[Path]) -> str:
    data = path.read_bytes()
    words = list(_NUMBER.finditer(data))
    if not words:
        return _run(rng, path, _others)
    word, new = rng.choice(words), rng.choice(_WORDS)
    path.write_bytes(data[: word.start()] + new + data[word.end() :])
    return f"{word.group()!r} at {word.start()} became {new[:24]!r}"


def _lines(rng: random.Random, path: Path, _others: list[Path]) -> str:
    lines = path.read_bytes().split(b"\n")
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(5):
        case 0:
            gone = lines.pop(at)
            said = f"line {at + 1} is gone: {gone[:40]!r}"
        case 1:
            lines.insert(other, lines[at])
            said = f"line {at + 1} again at {other + 1}"
        case 2:
            lines[at], lines[other] = lines[other], lines[at]
            said = f"lines {at + 1} and {other + 1} swapped"
        case 3:
            words = lines[at].split(b" ")
            rng.shuffle(words)
            lines[at] = b" ".join(words)
            said = f"words of line {at + 1} shuffled"
        case _:
            deep = rng.choice([b"x = " + b"[" * 5000, b"[" * 100_000, b'{"a":' * 5000, b"# \0\0"])
            lines.insert(at, deep)
            said = f"a line of {deep[:12]!r} ..."
    path.write_bytes(b"\n".join(lines))
    return said


def _kind(rng: random.Random, path: Path, others: list[Path]) -> str:
    """Another file, none, or a folder under its name."""
    match rng.randrange(4):
        case 0:
            path.unlink()
            return "it is missing"
        case 1:
            path.unlink()
            path.mkdir()
            return "it is a folder"
        case _:
            other = rng.choice([other for other in others if other.suffix != path.suffix])
            shutil.copyfile(other, path)
            return f"it is {other.name}"


def _arrays(rng: random.Random, path: Path, _others: list[Path]) -> str:
    with np.load(path) as archive:
        held = dict(archive)
    name = rng.choice(sorted(held))
    array = held[name]
    with np.errstate(all="ignore"):
        held[name], said = rng.choice(
            [
                (array.astype(float) * 5, "times 5"),
                (array.astype(float) * np.nan, "nan"),
                (array.astype(float) * 1e300, "times 1e300"),
                (array.ravel()[:-1], "one shorter"),
                (array.astype(str), "text"),
                (array[None], "one dimension more"),
                (np.array(7), "a number"),
                (array.astype(complex), "complex"),
                (-array.astype(float), "negative"),
                (array.astype("f2"), "of 16 bits"),
                (np.empty((0, *array.shape[1:])), "empty"),
            ]
        )
    if rng.random() < 0.1:
        del held[name]
        said = "missing"
    np.savez(path, **held)
    return f"{name} is {said}"
