"""From text to columns of numbers: whatever stands between them, and however much stands above them."""

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tagsway.model import FloatArray

DELIMITERS = ("\t", ";", ",", " ")
"""Between two cells; a space stands for any white space. Earlier ones win where two fit equally well."""

SAMPLE = 200
"""Lines, from the end of a file, by which the delimiter is told: whatever stands above the numbers is not there."""

MISSING = frozenset({"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "inf", "-inf", "undefined", "1.#qnan"})
"""How programs write that there is no number."""

_NUMBER = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?")
_TIME_CODE = re.compile(r"(?:\d+:)?\d{1,2}:\d{2}(?:[:.,;]\d{1,6})?|\d+:\d{2}:\d{2}[:.,;]\d{1,6}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """A block of numbers, and the rows above it.

    Parameters
    ----------
    head : tuple of tuple of str
        Rows above the numbers, the last one next to them; a line without a delimiter is a row of one cell.
    values : ndarray, shape (n, k)
        NaN where a cell holds no number; a time code is in seconds.
    first_line : int
        Where the numbers begin, from 1.
    coded_times : bool
        Whether the first column held time codes (h:mm:ss:cc), which are rounded.
    """

    head: tuple[tuple[str, ...], ...]
    values: FloatArray
    first_line: int
    coded_times: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns: the nearest row of as many cells, else numbers from 1."""
        width = self.values.shape[1]
        for row in reversed(self.head):
            # A trailing delimiter in the numbers, or in the names, is no column.
            if len(row) in (width, width - 1) and width > 1:
                return (*row, *["" for _ in range(width - len(row))])
        return tuple(str(number + 1) for number in range(width))


def find_grids(text: str) -> list[Grid]:
    """Return the blocks of numbers of a text, in their order.

    Parameters
    ----------
    text : str
        With newlines between its lines.

    Returns
    -------
    list of Grid
        A block ends where a line that is not empty holds no numbers, or another count of cells. Empty where there is
        no line with two columns, one of them of numbers.
    """
    lines = text.split("\n")
    return _blocks(_rows(lines, _delimiter([line for line in lines if line.strip()][-SAMPLE:])))


def find_grids_of_rows(rows: Sequence[Sequence[str]]) -> list[Grid]:
    """Return the blocks of numbers of a sheet that is cut into cells already."""
    return _blocks((number, tuple(cell.strip() for cell in row)) for number, row in enumerate(rows, start=1))


def _blocks(rows: Iterator[tuple[int, tuple[str, ...]]]) -> list[Grid]:
    grids: list[Grid] = []
    head: list[tuple[str, ...]] = []
    block: list[tuple[str, ...]] = []
    first = 0

    def close() -> None:
        nonlocal head, block
        if block:
            grids.append(_grid(head, block, first))
            head, block = [], []

    for number, row in rows:
        if not any(row):
            continue
        goes_on = bool(block) and len(row) == len(block[0]) and _holds_number(row[0])
        if not (goes_on or _is_data(row)):
            close()
            head.append(row)
            continue
        if block and len(row) != len(block[0]):
            close()
        if not block:
            first = number
        block.append(row)
    close()
    return grids


def _grid(head: list[tuple[str, ...]], block: list[tuple[str, ...]], first: int) -> Grid:
    values = np.array([[to_number(cell) for cell in row] for row in block])
    coded = any(_TIME_CODE.fullmatch(row[0]) for row in block[:3])
    return Grid(head=tuple(head), values=values, first_line=first, coded_times=coded)


def to_number(cell: str) -> float:
    """Return a cell's number, with a decimal point or comma; of a time code the seconds; NaN where it holds none."""
    try:
        return float(cell)
    except ValueError:
        pass
    if _NUMBER.fullmatch(cell):
        return float(cell.replace(",", "."))
    return _seconds(cell) if _TIME_CODE.fullmatch(cell) else float("nan")


def _seconds(code: str) -> float:
    """Return the seconds of h:mm:ss:cc, h:mm:ss, mm:ss.ff: what follows three numbers, or a point, is a fraction."""
    parts = re.split("[:.,;]", code)
    fraction = 0.0
    if len(parts) == 4 or not code[: -len(parts[-1])].endswith(":"):
        fraction = float(f"0.{parts.pop()}")
    return sum(float(part) * 60.0**power for power, part in enumerate(reversed(parts))) + fraction


def _is_data(row: Sequence[str]) -> bool:
    """Say whether a row is one of numbers: two of them, or one among empty cells."""
    numbers = sum(1 for cell in row if _holds_number(cell))
    missing = sum(1 for cell in row if cell.lower() in MISSING)
    return len(row) > 1 and (numbers >= 2 or (numbers == 1 and numbers + missing == len(row)))


def _holds_number(cell: str) -> bool:
    return bool(_NUMBER.fullmatch(cell) or _TIME_CODE.fullmatch(cell))


def _delimiter(lines: Sequence[str]) -> str:
    def fit(delimiter: str) -> float:
        share = 0.0
        for _, row in _rows(lines, delimiter):
            filled = [cell for cell in row if cell.lower() not in MISSING]
            if _is_data(row) and filled:
                share += sum(map(_holds_number, filled)) / len(filled)
        return share

    return max(DELIMITERS, key=fit)


def _rows(lines: Sequence[str], delimiter: str) -> Iterator[tuple[int, tuple[str, ...]]]:
    for number, line in enumerate(lines, start=1):
        if delimiter == " ":
            cells = line.split()
        else:
            cells = next(csv.reader([line.strip(" ")], delimiter=delimiter, skipinitialspace=True), [])
        yield number, tuple(cell.strip() for cell in cells)
