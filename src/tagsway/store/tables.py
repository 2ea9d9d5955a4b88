"""Tables of numbers as text: read whatever separates them, written with fixed decimals and no signed zero."""

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray

if TYPE_CHECKING:
    import pandas as pd

DECIMALS = 9
"""Of a metre: a position rounded to 1 µm is an acceleration that is wrong by 1 m/s² after two differences at 1 kHz."""


def rounded(values: FloatArray) -> FloatArray:
    """Return the values as they will be printed; adding 0 takes the sign off a zero."""
    result: FloatArray = np.round(values, DECIMALS) + 0.0
    return result


def number_table(columns: list[Any], formats: list[str], *, delimiter: str) -> str:
    """Return blocks of columns side by side as text.

    Parameters
    ----------
    columns : list of ndarray, shape (n, any)
        The blocks.
    formats : list of str
        How each block's numbers are printed, such as "%.9f".
    delimiter : str
        Between two numbers.
    """
    text = io.StringIO()
    each = [form for column, form in zip(columns, formats, strict=True) for _ in range(column.shape[1])]
    np.savetxt(text, np.hstack(columns), fmt=each, delimiter=delimiter)
    return text.getvalue()


def read_table(path: Path, *, expected: str) -> "pd.DataFrame":
    """Read a text table with a header; comma, semicolon or tab between the columns.

    Parameters
    ----------
    path : Path
        The file.
    expected : str
        What it should be, for the error.

    Raises
    ------
    InputError
        Where the file is no such table.
    """
    import pandas as pd  # most of what imports this module reads no table

    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as fault:
        raise InputError(f"{path}: {(fault.strerror or 'cannot be read').lower()}; give {expected}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path} is not a text table; give {expected}") from None
    if not text.strip():
        raise InputError(f"{path} is empty; give {expected}")
    header = text.lstrip().splitlines()[0]
    delimiter = max(",;\t", key=header.count)
    try:
        table = pd.read_csv(io.StringIO(text), sep=delimiter, skipinitialspace=True, quoting=csv.QUOTE_MINIMAL)
    except (pd.errors.ParserError, ValueError) as fault:
        raise InputError(f"{path} cannot be read as a table: {str(fault).strip().splitlines()[0]}") from None
    table.columns = pd.Index([str(name).strip() for name in table.columns])
    return table
