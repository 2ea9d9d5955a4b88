"""Studies as tables: for people, as CSV, and as JSON."""

import csv
import io
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from tagsway.model import LimitRow, Pair, StudyRow

WIDTH = 200
"""At most, of a table for people, in characters."""

COLUMNS = (
    ("shaping", "shaped"),
    ("max_acceleration_m_s2", "at\nm/s²"),
    ("frequency_hz", "f_n\nHz"),
    ("trajectory_time_s", "traject.\ns"),
    ("motion_time_s", "motion\ns"),
    ("pcp_acceleration_m_s2", "PCP |x''|\nm/s²"),
    ("pcp_vector_m_s2", "with g\nm/s²"),
    ("overshoot_percent", "over-\nshoot %"),
    ("overshoot_ratio_percent", "of un-\nshaped %"),
    ("residual_rms_m_s2", "RMS\nafter"),
    ("residual_reduction_percent", "reduced\nby %"),
    ("box_error_m", "in box\nmm"),
)
"""What a table for people shows of a row, and what it calls it."""

LENGTHS = ("box_error_m", "place_error_m")


def rows_table(rows: Sequence[StudyRow], *, title: str) -> str:
    """Return rows as a table for people."""
    return _draw(title, [name for _, name in COLUMNS], [[_cell(row, key) for key, _ in COLUMNS] for row in rows])


def limits_table(limits: Sequence[LimitRow], *, title: str) -> str:
    """Return limits as a table for people."""
    heads = [
        "limit",
        "shaped",
        "before the first\nm/s²",
        "motion\ns",
        "last feasible\nm/s²",
        "motion\ns",
        "overshoot\n%",
    ]
    body = []
    for found in limits:
        first, last = found.before_first, found.last_feasible
        open_end = "" if found.reached else " (not reached)"
        body.append(
            [
                _limit_words(found),
                found.shaping,
                _number(None if first is None else first.max_acceleration_m_s2) + open_end,
                _number(None if first is None else first.motion_time_s, 3),
                _number(None if last is None else last.max_acceleration_m_s2) + open_end,
                _number(None if last is None else last.motion_time_s, 3),
                _number(None if last is None else last.overshoot_percent),
            ]
        )
    return _draw(title, heads, body)


def pairs_words(pairs: Sequence[Pair]) -> str:
    """Return, for each unshaped move, the quickest shaped one that is no slower and overshoots no more."""
    lines = []
    for acceleration in dict.fromkeys(pair.unshaped.max_acceleration_m_s2 for pair in pairs):
        own = [pair for pair in pairs if pair.unshaped.max_acceleration_m_s2 == acceleration]
        best = min(own, key=lambda pair: (pair.shaped.motion_time_s or 0.0, pair.shaped.overshoot_percent))
        gentler = "" if best.gentler else ", though it accelerates the product more"
        lines.append(
            f"no slower than unshaped at {acceleration:g} m/s² ({_settling(best.unshaped)}, overshoot "
            f"{best.unshaped.overshoot_percent:.2f} %): {best.shaped.shaping} shaped at "
            f"{best.shaped.max_acceleration_m_s2:g} m/s² ({_number(best.shaped.motion_time_s, 3)} s, "
            f"{best.shaped.overshoot_percent:.2f} %){gentler}\n"
        )
    return "".join(lines) if lines else "no shaped move is as quick as an unshaped one and overshoots no more\n"


def _settling(row: StudyRow) -> str:
    return "never settles" if row.motion_time_s is None else f"{row.motion_time_s:.3f} s"


def rows_csv(rows: Sequence[StudyRow]) -> str:
    """Return rows as CSV; what is not known is empty, lengths are in mm."""
    names = [item.name for item in fields(StudyRow)]
    heads = {"frequency_hz": ["frequency_low_hz", "frequency_high_hz"]}
    heads |= {name: [name.removesuffix("_m") + "_mm"] for name in LENGTHS}
    first = [head for name in names for head in heads.get(name, [name])]
    return _csv([first, *([cell for name in names for cell in _plain(name, getattr(row, name))] for row in rows)])


def limits_csv(limits: Sequence[LimitRow]) -> str:
    """Return limits as CSV, each with its two moves."""
    heads = ["limit", "shaping", "reached", "scan_from_m_s2", "scan_to_m_s2"]
    moves = ("before_first", "last_feasible")
    heads += [f"{move}_{name}" for move in moves for name in _OF_A_MOVE]
    rows = [
        [_limit_words(found), found.shaping, str(found.reached).lower(), *_plain("scan_m_s2", found.scan_m_s2)]
        + [cell for row in (found.before_first, found.last_feasible) for cell in _move_cells(row)]
        for found in limits
    ]
    return _csv([heads, *rows])


def pairs_csv(pairs: Sequence[Pair]) -> str:
    """Return, as CSV, every unshaped move with every shaped one that is no slower and overshoots no more."""
    heads = ["shaping", "gentler", *(f"{move}_{name}" for move in ("unshaped", "shaped") for name in _OF_A_MOVE)]
    rows = [
        [pair.shaped.shaping, str(pair.gentler).lower(), *_move_cells(pair.unshaped), *_move_cells(pair.shaped)]
        for pair in pairs
    ]
    return _csv([heads, *rows])


_OF_A_MOVE = ("max_acceleration_m_s2", "motion_time_s", "overshoot_percent", "pcp_acceleration_m_s2")


def _move_cells(row: StudyRow | None) -> list[str]:
    """Return what a table says of one move; nothing where there is none."""
    return [cell for name in _OF_A_MOVE for cell in _plain(name, None if row is None else getattr(row, name))]


def _csv(rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _plain(name: str, value: Any) -> list[str]:
    if isinstance(value, tuple):
        return [f"{each:.6g}" for each in value]
    if value is None or isinstance(value, str):
        return [value or ""]
    return [f"{1e3 * value if name in LENGTHS else value:.6g}"]


def _cell(row: StudyRow, key: str) -> str:
    value = getattr(row, key)
    if isinstance(value, str):
        return value
    if isinstance(value, tuple):
        low, high = value
        return f"{low:.3g}" if low == high else f"{low:.3g}-{high:.3g}"
    if key == "motion_time_s" and value is None:
        return "never"
    if key in LENGTHS:
        return _number(None if value is None else 1e3 * value)
    return _number(value, 3 if key.endswith("time_s") else 2)


def _number(value: float | None, digits: int = 2) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _limit_words(found: LimitRow) -> str:
    return {
        "pcp_acceleration_m_s2": f"PCP |x''| ≤ {found.limit:g} m/s²",
        "overshoot_percent": f"overshoot ≤ {found.limit:g} %",
        "box_error_m": f"in the box ≤ {1e3 * found.limit:g} mm",
    }[found.quantity]


def _draw(title: str, heads: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Return a table of fixed width, whatever the terminal."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left", title_style="", box=box.SIMPLE_HEAD, pad_edge=False)
    for i, head in enumerate(heads):
        table.add_column(head, justify="left" if i == 0 else "right", no_wrap=True, header_style="")
    for row in body:
        table.add_row(*row)
    text = io.StringIO()
    Console(file=text, width=WIDTH, color_system=None).print(table)
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines()) + "\n"
