"""By what a file is known as flownav's, so that it may be replaced: a mark at a fixed place that no other program
writes.

A text begins with a line that has the SHA-256 of all that follows, so that one which was edited is no longer ours: who
edits a file has made it. JSON has no comments: there the digest is a key, and in a page's head an element. EuRoC's
tables begin with their columns' names: there it is one name more. Of other formats the mark is what their header says
of who wrote them. Notes that speak of flownav, and what another tool made, are not ours, whatever they say.
"""

import hashlib
import json
import mmap
import re
import zipfile
import zlib
from io import BufferedReader
from pathlib import Path
from typing import Any

LINE = "written by flownav; SHA-256 of what follows: "
HASH, XML = ("# ", ""), ("<!-- ", " -->")  # how a comment begins and ends
DECLARATION = "<?xml version='1.0' encoding='utf-8'?>\n"  # stands before the mark where there is one
TEXT = re.compile(
    rb"(?:(?:<\?xml [^>\n]{1,60}\?>\n)?(?:# |<!-- )|#timestamp [^\n]{1,400}?,)"
    + re.escape(LINE.encode())
    + rb"([0-9a-f]{64})(?: -->)?\n"
)
KEY = "flownav_sha256"  # of a JSON object, over the rest of it
PAGE_MARK = '<meta name="generator" content="flownav"><meta name="flownav-sha256" content="'  # of pages, in their head
PAGE_MARK_ENDS, DIGEST_LETTERS = '">', 64
LOOKED_AT_BYTES = 4096
MOST_JSON_BYTES = 4 << 20
MANIFEST, TABLE = "manifest.json", ".parquet"
RECORD_MARK = re.compile(  # first in its zip, as it is, of no date, and the schema first in it
    rb"PK\x03\x04.{2}\x00\x00\x00\x00\x00\x00\x21\x00.{12}\x0d\x00\x00\x00manifest\.json\{\n \"schema\": \d", re.DOTALL
)
RECORD_MAGIC, ULOG_MAGIC, HEAD_ENDS = b"PK\x03\x04", b"ULog", (b"<title", b"</head", b"<body")
ULOG_MARK = re.compile(rb"I.char\[\d{1,5}\] flownav_record", re.DOTALL)  # an information message of this key
HEADERS = (  # at a file's first byte
    re.compile(rb"\x89MCAP0\r\n\x01.{8}\x00{4}.{4}flownav \d", re.DOTALL),
    re.compile(rb"\x89PNG\r\n\x1a\n.{25}\x00\x00\x00\x10tEXtSoftware\x00flownav", re.DOTALL),
    re.compile(rb"RRF2.{0,200}?\x1a\x09\n\x07flownav", re.DOTALL),  # Rerun's: the application's name, in protobuf
)
ZIP_ERRORS = (
    OSError, zipfile.BadZipFile, zlib.error, KeyError, ValueError, NotImplementedError, RuntimeError, EOFError,
    RecursionError,
)  # fmt: skip


def marked(text: str, comment: tuple[str, str] = HASH) -> bytes:
    """A text as a file's bytes, with the mark. comment: how one begins and ends; bytes that are no text are written as
    escapes.
    """
    first = DECLARATION if text.startswith(DECLARATION) else ""
    rest = text[len(first) :].encode("utf-8", errors="backslashreplace")
    return f"{first}{comment[0]}{LINE}{hashlib.sha256(rest).hexdigest()}{comment[1]}\n".encode() + rest


def marked_page(page: str) -> bytes:
    """A page as a file's bytes, with the mark as the first of its head: the digest is of the page without it."""
    before, head, after = page.partition("<head>")
    text = [part.encode("utf-8", errors="backslashreplace") for part in (before + head, after)]
    mark = f"{PAGE_MARK}{hashlib.sha256(b''.join(text)).hexdigest()}{PAGE_MARK_ENDS}" if head else ""
    return mark.encode().join(text)


def marked_table(text: str) -> bytes:
    """A table whose first line are its columns' names, with the mark as one name more, of no column."""
    names, _, rest = text.partition("\n")
    return f"{names},{LINE}{hashlib.sha256(rest.encode()).hexdigest()}\n{rest}".encode()


def marked_json(entries: dict[str, Any], indent: int | None = 1) -> bytes:
    """A JSON object as a file's bytes, with the mark as its first key. indent: None for one line."""
    return (json.dumps({KEY: _digest(entries)} | entries, indent=indent) + "\n").encode()


def _digest(entries: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()


def is_ours(path: Path) -> bool:
    """Whether flownav wrote a file, as it is, and can write it again: no file that a user made, or flew, is lost."""
    try:
        with path.open("rb") as file:
            head = file.read(LOOKED_AT_BYTES)
            if found := TEXT.match(head):
                file.seek(found.end())
                return hashlib.file_digest(file, "sha256").hexdigest().encode() == found[1]
            if head.startswith(ULOG_MAGIC):
                with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
                    return ULOG_MARK.search(content) is not None
            if head.startswith(b"{"):
                return _is_our_json(head + file.read(MOST_JSON_BYTES))
            if not head.startswith(RECORD_MAGIC):
                return any(header.match(head) for header in HEADERS) or _is_our_page(head, file)
    except OSError:
        return False
    manifest = manifest_of(path) if RECORD_MARK.match(head) else None
    return manifest is not None and manifest.get("kind") != "live"  # no command makes a live session again


def is_signed(path: Path, by: Path) -> bool:
    """Whether another file of ours says that this one is as it was written: by its SHA-256."""
    try:
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return is_ours(by) and digest.encode() in by.read_bytes()
    except OSError:
        return False


def manifest_of(path: Path) -> dict[str, Any] | None:
    """The manifest of a record; None where a file is no record: a zip of one manifest and tables, and nothing else."""
    try:
        with zipfile.ZipFile(path) as bundle:
            names = bundle.namelist()
            if MANIFEST not in names or not all(name == MANIFEST or name.endswith(TABLE) for name in names):
                return None
            if bundle.getinfo(MANIFEST).compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                return None  # each other way of packing has errors of its own
            with bundle.open(MANIFEST) as file:
                parsed = json.loads(file.read(MOST_JSON_BYTES))
    except ZIP_ERRORS:
        return None
    return parsed if isinstance(parsed, dict) and isinstance(parsed.get("schema"), int) else None


def _is_our_json(text: bytes) -> bool:
    try:
        parsed = json.loads(text)
    except (ValueError, RecursionError):
        return False
    return isinstance(parsed, dict) and parsed.pop(KEY, None) == _digest(parsed)


def _is_our_page(head: bytes, rest: BufferedReader) -> bool:
    """By the first bytes of a file, and the file, of which they have been read."""
    lower = head.lower()
    if b"<html" not in lower:
        return False
    start, end = lower.find(b"<head"), min((lower.find(mark) for mark in HEAD_ENDS if mark in lower), default=len(head))
    place = head.find(PAGE_MARK.encode(), max(start, 0), end)
    if not 0 <= start < place or b"<!--" in head[:place]:  # in a comment somebody only speaks of it
        return False
    digest = place + len(PAGE_MARK)
    ends = digest + DIGEST_LETTERS
    others = hashlib.sha256(head[:place] + head[ends + len(PAGE_MARK_ENDS) :])
    return hashlib.file_digest(rest, lambda: others).hexdigest().encode() == head[digest:ends]
