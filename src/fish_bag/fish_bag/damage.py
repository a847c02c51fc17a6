# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Random damage to recordings, and what recovery must give back of them: for tests and benchmarks."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mcap.records import Chunk
from mcap.stream_reader import StreamReader

from fish_bag.bag import RawBag, read_bag, salvage_bag
from fish_bag.problem import RecordingError
from fish_bag.recording_files import is_storage_file

# formats in which a checksum protects every message; in the others a changed byte of a message cannot be seen
PROTECTED = ("own", "bare", "bare zstd", "bare lz4")
KINDS = ("cut", "zero tail", "flip", "byte", "run", "hole")
SURE_BYTES = 40  # a shorter message may stand in the file by chance
Message = tuple[str, int, bytes]  # topic, arrival [ns], raw


@dataclass
class Sample:
    """A whole recording and where each of its messages ends."""

    name: str
    path: Path  # as it is given to the reader
    file: Path  # its storage file
    data: bytes = field(repr=False)
    messages: Counter[Message] = field(repr=False)
    ends: list[tuple[int, Message]] = field(
        default_factory=list, repr=False
    )  # byte after the message
    chunk_ends: list[tuple[int, int]] = field(default_factory=list)  # first and last byte of chunks


def make_sample(name: str, path: Path) -> Sample:
    """Learn a whole recording by heart."""
    file = path if path.is_file() else next(p for p in path.iterdir() if is_storage_file(p))
    data, bag = file.read_bytes(), read_bag(path, lambda *_: True)
    sample = Sample(name, path, file, data, Counter(messages_of(bag)))
    for message in sample.messages:  # found where the file is not packed
        found = data.find(message[2]) if len(message[2]) >= SURE_BYTES else -1
        if found >= 0:
            sample.ends.append((found + len(message[2]), message))
    if file.suffix == ".mcap":
        with file.open("rb") as stream:
            for record in StreamReader(stream, emit_chunks=True).records:
                if isinstance(record, Chunk):
                    end = stream.tell()
                    sample.chunk_ends.append((end - len(record.data), end))
    return sample


def messages_of(bag: RawBag) -> Iterable[Message]:
    """Every message of a bag."""
    for raw in bag.topics:
        for time_ns, message in zip(raw.arrival_ns.tolist(), raw.raws, strict=True):
            yield raw.topic, time_ns, message


def damaged(data: bytes, kind: str, rng: np.random.Generator) -> tuple[bytes, int]:
    """The data with one damage, and the first byte that it changed."""
    at = int(rng.integers(1, len(data)))
    broken = bytearray(data)
    if kind == "cut":
        return bytes(broken[:at]), at
    if kind == "zero tail":
        end = int(rng.integers(at + 1, len(data) + 4096))
        return bytes(broken[:at]) + bytes(end - at), at
    if kind == "flip":
        broken[at] ^= 1 << int(rng.integers(8))
    elif kind == "byte":
        broken[at] = int(rng.integers(256))
    else:
        count = int(rng.integers(1, 300))
        run = bytes(count) if kind == "hole" else rng.bytes(count)
        broken[at : at + count] = run[: len(data) - at]
    return bytes(broken), at


def check(sample: Sample, kind: str, broken: bytes, at: int, folder: Path) -> str:
    """What recovery does wrong with a damaged recording, "" for nothing."""
    path = folder / sample.path.name
    if sample.path.is_dir():
        shutil.copytree(sample.path, path, dirs_exist_ok=True)
        file = path / sample.file.name
    else:
        file = path
    file.write_bytes(broken)
    try:
        saved = Counter(messages_of(salvage_bag(path)))
    except RecordingError as error:
        return f"RecordingError: {error}" if at > 16 else ""
    except Exception as error:  # whatever it is, it is what is looked for here
        return f"{type(error).__name__}: {error}"
    tail = kind in ("cut", "zero tail")
    invented = saved - sample.messages
    if invented and (tail or sample.name in PROTECTED):
        topic, time_ns, raw = next(iter(invented))
        return (
            f"invented {invented.total()} messages, one of {topic} at {time_ns}, {len(raw)} bytes"
        )
    missing = [m for m in whole_before(sample, tail, broken, at) if m not in saved]
    return (
        f"lost {len(missing)} messages, one of {missing[0][0]} at {missing[0][1]}"
        if missing
        else ""
    )


def whole_before(sample: Sample, tail: bool, broken: bytes, at: int) -> list[Message]:
    """Messages that end before the damage; of a chunk that is damaged inside, none can be told from damaged ones."""
    limit = min(at, len(broken.rstrip(b"\0"))) if tail else at
    if not tail:
        for first, last in sample.chunk_ends:
            if first - 60 <= at < last:
                limit = first - 60
    return [message for end, message in sample.ends if end <= limit]
