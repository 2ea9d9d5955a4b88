"""From a file's bytes to its text, whoever wrote it."""

import codecs
from pathlib import Path

from tagsway.errors import InputError

MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
"""Byte order marks; UTF-32 is not written by anything that records a motion."""

BINARY = (
    (
        b"PK\x03\x04",
        "a zip file, such as an .xlsx or .ods sheet or phyphox' archive: unpack it, or save the sheet as CSV",
    ),
    (b"\xd0\xcf\x11\xe0", "an old Excel file: save it as CSV"),
)
"""How files begin that hold a table and are no text, and what to do about each."""


def read_text(path: Path, *, expected: str) -> str:
    """Return a table's text, whatever its encoding and line ends.

    Parameters
    ----------
    path : Path
        The file.
    expected : str
        What it should be, for the error.

    Returns
    -------
    str
        With newlines alone between its lines; UTF-8 with or without a mark, UTF-16 (also without one), else Windows'
        western code page, in which at least the numbers are right.

    Raises
    ------
    InputError
        Where it cannot be read, is empty, or is no text.
    """
    try:
        data = path.read_bytes()
    except OSError as fault:
        raise InputError(f"{path}: {(fault.strerror or 'cannot be read').lower()}; give {expected}") from None
    for start, advice in BINARY:
        if data.startswith(start):
            raise InputError(f"{path} is {advice}; expected {expected}")
    try:
        text = data.decode(_encoding(data))
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    if "\x00" in text:
        raise InputError(f"{path} is no text with columns; give {expected}")
    if not text.strip():
        raise InputError(f"{path} is empty; give {expected}")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _encoding(data: bytes) -> str:
    for mark, name in MARKS:
        if data.startswith(mark):
            return name
    # In UTF-16 every other byte of a number is zero.
    head = data[:2000]
    if len(head) >= 4 and head[1::2].count(0) > 0.4 * len(head) / 2 and 0 not in head[0::2]:
        return "utf-16-le"
    if len(head) >= 4 and head[0::2].count(0) > 0.4 * len(head) / 2 and 0 not in head[1::2]:
        return "utf-16-be"
    return "utf-8"
