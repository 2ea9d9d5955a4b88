"""measurements.csv, .parquet and summary.csv: one row a measurement, one row a subset."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from tagsway.errors import InputError
from tagsway.files import whole_file
from tagsway.model import DesignMode, FloatArray, Spread
from tagsway.repeats import between_repeat_spread, fit_random_effects
from tagsway.store.tables import read_table

if TYPE_CHECKING:
    import pandas as pd

FREQUENCY, DAMPING = "natural_frequency_hz", "damping_ratio"
FREQUENCY_STD = "natural_frequency_std_hz"
OPERATING, AMPLITUDE = "operating_frequency_hz", "amplitude_mm"


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredModes:
    """The same mode in many measurements.

    Parameters
    ----------
    frequency_hz, damping_ratio : ndarray, shape (n,)
        Of each measurement that was used.
    source : str
        The file's name.
    frequency_std_hz : ndarray, shape (n,), optional
        Each measurement's own standard error.
    operating_hz, amplitude_mm : ndarray, shape (n,), optional
        The frequency at each measurement's mean amplitude, and that; NaN where it is not told.
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    source: str
    frequency_std_hz: FloatArray | None = None
    operating_hz: FloatArray | None = None
    amplitude_mm: FloatArray | None = None

    @property
    def mode(self) -> DesignMode:
        """What a shaper is designed for, the medians: one bad measurement does not move them.

        At the operating amplitude, where that is told: of a large swing a payload is slower.
        """
        operating, amplitude = self.frequency_hz, None
        if self.operating_hz is not None:
            operating = np.where(self.operating_hz > 0, self.operating_hz, operating)
            known = self.amplitude_mm if self.amplitude_mm is not None else np.array([])
            amplitude = float(np.nanmedian(known)) / 1e3 if np.isfinite(known).any() else None
        return DesignMode(
            frequency_hz=float(np.median(operating)),
            damping_ratio=float(np.median(self.damping_ratio)),
            amplitude_m=amplitude,
        )

    @property
    def natural_frequency_hz(self) -> float:
        """The median, of a small swing."""
        return float(np.median(self.frequency_hz))

    @property
    def spread(self) -> Spread | None:
        """What differs between the measurements; None of a single one.

        Their standard deviation; where each states its own error, that is taken out: a shaper has to bear how the
        payload varies, not how well it was measured. What the errors explain alone leaves the whole deviation.
        """
        n = len(self.frequency_hz)
        if n < 2:
            return None
        std = self.frequency_std_hz
        if std is not None and np.all(std > 0) and np.all(np.isfinite(std)):
            spread = between_repeat_spread(fit_random_effects(self.frequency_hz, std), source=self.source)
            if spread.natural_frequency_std_percent > 0:
                return spread
        percent = 100 * float(np.std(self.frequency_hz, ddof=1)) / self.natural_frequency_hz
        return Spread(source=self.source, natural_frequency_std_percent=percent, n=n)


def read_measurements(path: Path) -> MeasuredModes:
    """Read the modes of a set's measurements.csv.

    Parameters
    ----------
    path : Path
        A table with the columns natural_frequency_hz and damping_ratio. Rows in which `rejected_by` says something,
        or in which both numbers are missing, are left out; of a set's own table (it has a `status`) also those in
        which one is: the film did not tell it.

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
    import pandas as pd

    table = read_table(path, expected="a measurements.csv")
    for name in (FREQUENCY, DAMPING):
        if name not in table:
            raise InputError(
                f"{path} has no column {name!r}: expected {FREQUENCY} and {DAMPING}; it has "
                f"{', '.join(map(str, table.columns))}"
            )
    missing: Literal["any", "all"] = "any" if "status" in table else "all"
    named = (FREQUENCY, DAMPING, FREQUENCY_STD, OPERATING, AMPLITUDE, "rejected_by")
    table = table[[name for name in named if name in table]]
    if "rejected_by" in table:
        reason = table["rejected_by"]
        table = table[reason.isna() | (reason.astype(str).str.strip() == "")]
    table = table.dropna(subset=[FREQUENCY, DAMPING], how=missing)
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
    std, operating, amplitude = (
        pd.to_numeric(table[name], errors="coerce").to_numpy(dtype=float) if name in table else None
        for name in (FREQUENCY_STD, OPERATING, AMPLITUDE)
    )
    return MeasuredModes(
        frequency_hz=frequency,
        damping_ratio=damping,
        source=path.name,
        frequency_std_hz=std,
        operating_hz=operating,
        amplitude_mm=amplitude,
    )


def write_table(path: Path, table: "pd.DataFrame") -> None:
    """Write a table as CSV or Parquet, as its name ends; whole or not at all, and the same bytes for the same table.

    Raises
    ------
    ImportError
        For Parquet, where pyarrow is not installed.
    """
    with whole_file(path) as part:
        if path.suffix == ".parquet":
            table.to_parquet(part, index=False)
        else:
            table.to_csv(part, index=False, lineterminator="\n", encoding="utf-8")
