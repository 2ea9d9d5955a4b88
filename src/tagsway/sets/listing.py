"""A table of files: set.csv."""

import csv
from pathlib import Path
from typing import Any

from tagsway.errors import InputError


def read_listing(path: Path) -> list[dict[str, str]] | None:
    """Return the rows of a table of files; None where it has no column `file`, as a track has none."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as text:
            header = text.readline()
            text.seek(0)
            delimiter = max(",;\t", key=header.count)
            reader = csv.DictReader(text, delimiter=delimiter, skipinitialspace=True, restval="")
            if "file" not in [name.strip() for name in reader.fieldnames or ()]:
                return None
            names = [name.strip() for name in reader.fieldnames or ()]
            if twice := sorted({name for name in names if name and names.count(name) > 1}):
                raise InputError(f"{path} has two columns {twice[0]!r}: expected each name once")
            reader.fieldnames = names
            rows = []
            for row in reader:
                if any(field.strip() for field in row.pop(None, ())):
                    raise InputError(f"{path}, line {reader.line_num}: expected as many fields as the first line has")
                rows.append(row)
            return rows
    except (UnicodeDecodeError, csv.Error):
        raise InputError(f"{path} is not a text table; give a table with a column 'file'") from None


def number_or_text(text: str) -> Any:
    """Return a field of a table as a number, true or false, or a word; 3_1 is a word, as a sample may be called."""
    text = text.strip()
    if text in ("true", "false"):
        return text == "true"
    for kind in () if "_" in text else (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
