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
            reader.fieldnames = [name.strip() for name in reader.fieldnames or ()]
            rows = []
            for row in reader:
                if any(field.strip() for field in row.pop(None, ())):
                    raise InputError(f"{path}, line {reader.line_num}: expected as many fields as the first line has")
                rows.append(row)
            return rows
    except (UnicodeDecodeError, csv.Error):
        raise InputError(f"{path} is not a text table; give a table with a column 'file'") from None


def number_or_text(text: str) -> Any:
    """Return a field of a table as TOML would read it: a number, true or false, or a word."""
    text = text.strip()
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
