# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every message of a sqlite3 recording of rosbag2, also of one whose recorder was killed or whose file is damaged.

The file is opened as sqlite3 asks for it: changes that still stand in its `-wal` or `-journal` file are taken in, in a copy.
What sqlite3 cannot read is read from the pages of the file one by one.
Source: rosbag2_storage_sqlite3, schema versions 1 to 4.
"""

from __future__ import annotations

import shutil
import sqlite3
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from fish_bag.message_types import ros2_type_name
from fish_bag.problem import RecordingError
from fish_bag.sqlite_pages import NO_GAPS, Gaps, Log, Row, Value, read_log, rows
from fish_bag.storage import (
    ENOUGH_OTHERS,
    Contents,
    Keep,
    Messages,
    StoredTopic,
    end_of_content,
    ends_like_others,
    keep_whole,
)

MAGIC = b"SQLite format 3\0"
LOG = "-wal"
ROLLBACK = b"\1\1"  # file format versions of a database without a write-ahead log
COMPANIONS = (LOG, "-journal")  # hold what is not yet, or no more, in the database
TOPIC_COLUMNS = ("serialization_format", "offered_qos_profiles", "type_description_hash")
TABLES = "SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name"
ENCODINGS = ("ros2msg", "ros2idl", "unknown", "")


def scan_sqlite(path: Path, keep: Keep = keep_whole) -> Contents:
    """Collect every message that can be read.

    Args:
        path: the database, or a symbolic link to it; its companions (-wal, -journal) lie in its folder.
        keep: how many bytes of the messages of a topic are kept.
    """
    if path.is_symlink() and not companions(
        path
    ):  # sqlite3 too looks for them where the database lies
        path = path.resolve()
    with _settled(path) as settled:
        contents = Contents(notes=settled.notes)
        try:
            if settled.lost:
                raise sqlite3.DatabaseError(settled.lost)
            _read(settled.path, contents, keep)
            head = path.read_bytes()  # the database without its companions
            content_end = end_of_content(head)
            if content_end < len(head):
                _drop_zeroed(settled.path.read_bytes(), content_end, contents)
        except RecordingError as error:
            raise RecordingError(f"{path}: {error}") from error
        except (sqlite3.Error, UnicodeDecodeError) as error:
            contents = Contents(notes=settled.notes)
            said = " ".join(str(error).split())
            contents.lost.append(f"the database is damaged ({said}); its pages are read one by one")
            _read_pages(settled.path.read_bytes(), contents, settled.gaps)
        alone = _alone(path, keep) if settled.notes or settled.lost else None
    if alone is not None and (sign := _sign_of_another(path, alone, contents)):
        alone.lost.append(
            f"{path.name}{LOG} belongs to another database: {sign}; this one is read without it, and what stands in it"
            " is left out"
        )
        contents = alone
    contents.drop_undefined()
    return contents


def _alone(path: Path, keep: Keep) -> Contents | None:
    """What the database holds without its companions; None where it cannot be read so, or holds nothing."""
    contents = Contents()
    try:
        _read(path, contents, keep)
    except (sqlite3.Error, UnicodeDecodeError, RecordingError):
        return None
    return contents if contents.count else None


def _sign_of_another(path: Path, alone: Contents, contents: Contents) -> str:
    """By what one sees that the log is not that of the database; "" where it may be."""
    log = Path(f"{path}{LOG}")
    if not (log.exists() and log.stat().st_size):
        return ""
    with path.open("rb") as file:
        head = file.read(20)
    if head[18:20] == ROLLBACK:
        return "the database keeps no write-ahead log"
    before, after = (
        Counter(
            (part.topics[channel].name, time)
            for channel, messages in part.messages.items()
            if channel in part.topics
            for time in messages.times
        )
        for part in (alone, contents)
    )
    gone = (before - after).total()  # a recorder changes and deletes none
    return f"with it {gone} of {alone.count} messages are gone" if gone else ""


def companions(path: Path) -> list[Path]:
    """Files with something in them that belong to the database."""
    files = [Path(f"{path}{end}") for end in COMPANIONS]
    return [file for file in files if file.exists() and file.stat().st_size]


@dataclass(frozen=True)
class Settled:
    """A database with everything that its companions hold."""

    path: Path
    notes: list[str] = field(default_factory=list)
    lost: str = ""  # what cannot be read of the companions
    gaps: Gaps = NO_GAPS


@contextmanager
def _settled(path: Path) -> Iterator[Settled]:
    """The database with everything that its companions hold."""
    found = companions(path)
    if not found:
        yield Settled(path)
        return
    names = ", ".join(file.name for file in found)
    log_file = Path(f"{path}{LOG}")
    log = read_log(log_file.read_bytes()) if log_file in found else Log()
    with TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        gone = log.missing_pages(path.stat().st_size)
        # sqlite3 throws away the log of an empty database, and takes zeros for pages that are missing
        if log.lost or gone or not path.stat().st_size:
            data, gaps = log.applied(path.read_bytes())
            copy.write_bytes(data)
            lost = f"{log_file.name}: {log.lost}" if log.lost else ""
            if gone and not lost:
                lost = f"it is cut: {gone} of its {log.committed_pages} pages are missing"
            notes = [] if lost else [f"empty; what stands in {names} is read"]
            yield Settled(copy, notes, lost, gaps)
            return
        for file in (path, *found):
            shutil.copyfile(file, Path(folder) / file.name)
        notes = [f"the recorder did not close it; {names} is taken in as sqlite3 does it"]
        lost = ""
        try:
            with closing(sqlite3.connect(copy)) as connection:
                connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
        except sqlite3.Error as error:
            lost = f"{names} cannot be read ({error}); what stands in it is missing"
        yield Settled(copy, notes, lost)


def _read(path: Path, contents: Contents, keep: Keep) -> None:
    """Read a database that is whole; sqlite3.Error where it is not, RecordingError where it is something else."""
    address = path.absolute().as_uri() + "?mode=ro&immutable=1"
    with closing(sqlite3.connect(address, uri=True)) as connection:
        (page_bytes,) = connection.execute("PRAGMA page_size").fetchone()
        if path.stat().st_size % page_bytes:  # sqlite3 takes zeros for the rest of the last page
            raise sqlite3.DatabaseError("its last page is cut off")
        found = connection.execute("PRAGMA quick_check(1)").fetchone()
        if found is None or found[0] != "ok":
            raise sqlite3.DatabaseError(found[0] if found else "no answer")
        tables = [row[0] for row in connection.execute(TABLES)]
        if tables and not {"topics", "messages"} & set(tables):
            raise RecordingError(
                f"a SQLite database with the tables {', '.join(tables[:5])}, not a recording; expected rosbag2's tables"
                " topics and messages"
            )
        definitions = {}
        if _columns(connection, "message_definitions"):
            query = (
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
            definitions = {
                name: (text.encode(), encoding)
                for name, encoding, text in connection.execute(query)
            }
        optional = [c for c in TOPIC_COLUMNS if c in _columns(connection, "topics")]
        kept = {}
        for number, name, kind, *more in connection.execute(
            f"SELECT id, name, type, {', '.join(optional)} FROM topics"
        ):
            values = dict(zip(optional, more, strict=True))
            contents.topics[number] = _topic(name, kind, values, definitions)
            kept[number] = keep(contents.topics[number])
        _read_messages(connection, contents, kept)
        if _columns(connection, "metadata"):
            last = connection.execute("SELECT metadata FROM metadata ORDER BY id DESC").fetchone()
            contents.metadata = str(last[0]) if last else ""


def _read_messages(
    connection: sqlite3.Connection, contents: Contents, kept: dict[int, int | None]
) -> None:
    messages = contents.messages
    query = "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
    strange = 0
    for topic, time_ns, raw in connection.execute(query):
        if not isinstance(topic, int) or not isinstance(time_ns, int):
            strange += 1
            continue
        if topic not in messages:
            messages[topic] = Messages()
        data = raw if isinstance(raw, bytes) else str(raw or "").encode()
        messages[topic].add(time_ns, data[: kept.get(topic)])
    if strange:
        contents.lost.append(f"{strange} messages whose topic or time is no whole number")


def _columns(connection: sqlite3.Connection, table: str) -> set[str]:
    return {row[1] for row in connection.execute(f"PRAGMA table_info({table})")}


def _topic(
    name: str, kind: str, values: dict[str, str], definitions: dict[str, tuple[bytes, str]]
) -> StoredTopic:
    definition, encoding = definitions.get(kind, (b"", ""))
    serialization = values.get("serialization_format") or "cdr"
    qos = values.get("offered_qos_profiles") or ""
    identity = values.get("type_description_hash") or ""
    return StoredTopic(
        name, ros2_type_name(kind), serialization, definition, encoding, qos, identity
    )


def _read_pages(data: bytes, contents: Contents, gaps: Gaps) -> None:
    """Sort the rows of all pages into topics, definitions and messages by the kinds of their columns."""
    end = range(end_of_content(data), len(data))
    gaps = replace(gaps, zeros=[*gaps.zeros, end])
    topics: dict[int, list[str]] = {}
    definitions: dict[str, tuple[bytes, str]] = {}
    messages: dict[tuple[int, tuple[Value, ...]], Row] = {}  # damage may give two the same number
    for row in rows(data, gaps=gaps):
        values = row.values[1:]
        texts = [value for value in values if isinstance(value, str)]
        if row.values[:1] != (None,) or (row.in_zeros and len(texts) == len(values)):
            continue
        if len(texts) == len(values) >= 3:
            if texts[0].startswith("/"):
                topics.setdefault(row.number, texts)
            elif texts[1] in ENCODINGS:
                definitions.setdefault(texts[0], (texts[2].encode(), texts[1]))
        elif [type(value) for value in values] == [int, int, bytes]:
            messages.setdefault((row.number, row.values), row)
    for number, texts in topics.items():
        named = dict(zip(TOPIC_COLUMNS, texts[2:], strict=False))
        contents.topics[number] = _topic(texts[0], texts[1], named, definitions)
    _keep_whole(list(messages.values()), contents)


def _drop_zeroed(data: bytes, content_end: int, contents: Contents) -> None:
    """Take out a message whose end the zeros from byte `content_end` on have overwritten: sqlite3 does not see that."""
    for row in rows(data, content_end, Gaps(zeros=[range(content_end, len(data))])):
        if not row.in_zeros or [type(v) for v in row.values[1:]] != [int, int, bytes]:
            continue
        _, topic, _, raw = row.values
        if not (isinstance(topic, int) and isinstance(raw, bytes)):
            continue
        found = contents.messages.get(topic, Messages())
        place = len(found) - 1  # not by its time, which sqlite3 takes from an index
        while place >= 0 and found.raws[place] != raw:
            place -= 1
        others = found.raws[:place] + found.raws[place + 1 :]
        if place >= 0 and len(others) >= ENOUGH_OTHERS and not ends_like_others(raw, others):
            del found.times[place], found.raws[place]
            contents.lost.append("a message that reaches into zeros")


def _keep_whole(found: list[Row], contents: Contents) -> None:
    """Take the messages in order of their rows, but none that reaches into zeros that damage has left."""
    late: list[tuple[int, int, bytes]] = []
    for row in sorted(found, key=lambda row: row.number):
        _, topic, time_ns, raw = row.values
        if not (isinstance(topic, int) and isinstance(time_ns, int) and isinstance(raw, bytes)):
            continue
        if row.in_zeros or row.zeros_follow:
            late.append((topic, time_ns, raw))
        else:
            contents.messages.setdefault(topic, Messages()).add(time_ns, raw)
    for topic, time_ns, raw in late:
        if ends_like_others(raw, contents.messages.setdefault(topic, Messages()).raws):
            contents.messages[topic].add(time_ns, raw)
        else:
            contents.lost.append("a message that reaches into zeros")
