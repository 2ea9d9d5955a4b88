"""measurements.csv: one row a measurement, as a shaper's design needs it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from tagsway.errors import InputError
from tagsway.model import DesignMode, FloatArray, Spread
from tagsway.store.tables import read_table

FREQUENCY, DAMPING = "natural_frequency_hz", "damping_ratio"


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredModes:
    """The same mode in many measurements.

    Parameters
    ----------
    frequency_hz, damping_ratio : ndarray, shape (n,)
        Of each measurement that was used.
    source : str
        The file's name.
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    source: str

    @property
    def mode(self) -> DesignMode:
        """The median of both: one bad measurement does not move it."""
        return DesignMode(
            frequency_hz=float(np.median(self.frequency_hz)), damping_ratio=float(np.median(self.damping_ratio))
        )

    @property
    def spread(self) -> Spread | None:
        """The standard deviation of the frequency between the measurements; None of a single one."""
        n = len(self.frequency_hz)
        if n < 2:
            return None
        percent = 100 * float(np.std(self.frequency_hz, ddof=1)) / self.mode.frequency_hz
        return Spread(source=self.source, natural_frequency_std_percent=percent, n=n)


def read_measurements(path: Path) -> MeasuredModes:
    """Read the modes of a set's measurements.csv.

    Parameters
    ----------
    path : Path
        A table with the columns natural_frequency_hz and damping_ratio. Rows in which `rejected_by` says something,
        or in which both numbers are missing, are left out.

    Returns
    -------
    MeasuredModes
        At least one.

    Raises
    ------
    InputError
        Where the file is no such table, no row is left, or a row holds a frequency or a damping ratio that cannot be:
        names the row.
    """
    table = read_table(path, expected="a measurements.csv")
    for name in (FREQUENCY, DAMPING):
        if name not in table:
            raise InputError(
                f"{path} has no column {name!r}: expected {FREQUENCY} and {DAMPING}; it has "
                f"{', '.join(map(str, table.columns))}"
            )
    table = table[[name for name in (FREQUENCY, DAMPING, "rejected_by") if name in table]]
    if "rejected_by" in table:
        table = table[table["rejected_by"].fillna("").astype(str).str.strip() == ""]
    table = table.dropna(subset=[FREQUENCY, DAMPING], how="all")
    values = table[[FREQUENCY, DAMPING]].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    frequency, damping = values.T
    for name, faulty in (
        (FREQUENCY, ~((frequency > 0) & np.isfinite(frequency))),
        (DAMPING, ~((damping >= 0) & (damping < 1))),
    ):
        if faulty.any():
            row = int(np.argmax(faulty))
            expected = "more than 0 Hz" if name == FREQUENCY else "a damping ratio from 0 up to 1"
            raise InputError(
                f"{path}, line {table.index[row] + 2}: {name} is {table[name].iloc[row]!s}, expected {expected}; mend "
                "the row or say in rejected_by why it does not count"
            )
    if not len(values):
        raise InputError(f"{path} holds no measurement that can be used: every row is empty or rejected")
    return MeasuredModes(frequency_hz=frequency, damping_ratio=damping, source=path.name)
