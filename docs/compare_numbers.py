"""Write numbers.md: python docs/compare_numbers.py [acceptance.json].

The reference numbers are not part of this repository; by default they are looked for beside it, in
../shared/notes/acceptance.json.
"""

import itertools
import json
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import recompute_moves as moves
import recompute_shapers as shapers
from rows import Row

HERE = Path(__file__).parent
REFERENCE = HERE.parents[1] / "shared" / "notes" / "acceptance.json"

SECTIONS = {
    "1_shapers": shapers.impulse_shapers,
    "2_seed002_table5": shapers.dual_mode_steps,
    "3_seed001": shapers.zero_delay,
    "4_seed004": moves.corners,
    "5_pendulum": moves.pendulums,
    "6_trajectory": moves.reference_move,
    "7_delta_ik_deg": moves.delta_robots,
}
"""By the name of the section in the reference."""


NOT_COMPUTED = {
    "fit_corrected_A": "input: the impulses of a published fit, whose V stands in the table; tagsway solves exactly",
    "fit_as_printed_seed002_A": "input: the same fit with its misprint",
    "fit_t2_over_Td": "input: the same fit's second time",
    "needed_m225": "input: the pendulums whose modes stand in the table under `targets`",
    "table_8_5_optimiser": "a search with the payload simulated: docs/studies.md",
    "F_mm_s": "input",
    "f_Hz": "input",
    "zeta": "input",
    "g": "input",
    "tol": "a tolerance",
    "tol_s": "a tolerance",
    "published": "the published value of a row",
}
"""Parts of a path in the reference that have no row, and why."""

TITLES = {
    "1_shapers": "Impulse shapers (documents 1 and 3)",
    "2_seed002_table5": "Document 3, Table 5: steps through shapers designed 10 % low",
    "3_seed001": "Document 2: zero time delay",
    "4_seed004": "Document 4: prefilters and corners",
    "5_pendulum": "Document 1, Table 6.1: pendulums and their modes",
    "6_trajectory": "Document 1: the pick-and-place, and its motion times",
    "7_delta_ik_deg": "Documents 1 and 3: joint angles of the deltas, in degrees",
    "beyond": "Beyond the reference: text and figures of documents 3 and 4",
}

HEAD = """# Every number of the four documents

Written by `python docs/compare_numbers.py`; do not edit. *Published* is what the document prints, *recomputed* what an
independent implementation gives for the same question, *ours* what tagsway gives now, and *pass* whether ours is the
recomputed value within the tolerance, the largest distance that is allowed. Numbers that belong together share a row.
Where published and recomputed differ by more than rounding, the document's number does not follow from its own
statements: "What the documents say that is not so" says why.

The documents: 1 the thesis (delta robot, AprilTags, ZV), 2 modified zero time delay, 3 dual-mode shaping of a delta,
4 hybrid prefilters and corners of a SCARA.
"""

NOT_SO = """## What the documents say that is not so

Document 1
- An EI shaper of 5 % leaves {ei:.2f} % at ±15 %, not 1.4 %; ZVD {zvd:.2f} %, which rounds to 5, not 6.
- The pendulums of Table 6.1 have {flex:.3f} and {stiff:.3f} Hz and damping ratios of {flex_zeta:.1e} and
  {stiff_zeta:.2f}, not the 2.4727 and 3.5906 Hz, 3.5e-4 and 0.0012 that they were fitted to: in no reading, with either
  mass, with stiffness and damping as printed or swapped as in its code.
- Equation 3.1 lacks the square of δ under its root; Table 6.1 and the code swap damping and stiffness; 225 g here are
  255 g there; metres go into a kinematics in mm; the percentages of 8.3 are over the new time.

Document 2
- "About 40 %" of delay is {delay:.1f} % of the move.
- The modified version is not as robust as its ZVD: with the frequency 10 % low, a quintic move leaves
  {mztd:.4f} of its way, with the ZVD {zvd_left:.4f}, with no shaper {none_left:.4f}.

Document 3
- Its frequencies are in rad/s, though it writes Hz.
- The dual-mode rows of Table 5 are no convolutions: "ZVD-ZVD" settles there before half of its impulses have come. The
  recomputed rows are those of the convolutions.
- So ZVD-EI is not 24 % and 17 % quicker than ZVD: with the design 10 % low it settles in {zvdei:.3f} s, ZVD in
  {zvd10:.3f} s. It is quicker from 20 % on only.
- ZVDD's last impulse comes at 3T/2; in its EI fit A3 has -4.90094 Vζ² and A1 0.24968; equation 25 has six impulses;
  equation 4 lacks A_i.
- Its path of 0.6048 m: straights and chords are {chords:.4f} m, and no arc that is tangent to both straights fits.
- P5 needs {p5:.1f}° with leg 1 at -y, above its own limit of 75°; with leg 1 on -x it needs {p5x:.1f}°.

Document 4
- A FIR of one damped period leaves {fir:.2f} % at ζ = 0.022 and {fir1:.2f} % at ζ = 0.1, not nothing.
- The perpendicular foot that its corner plan looks for does not exist for sharp turns of asymmetric impulse shapers:
  above {zv_foot:.1f}° with ZV and {zvd_foot:.1f}° with ZVD; the least distance counts there.
"""

NAMED = {
    "ei": ("1_shapers / EI_V5_exact_V_percent_at_15pct", 1),
    "zvd": ("1_shapers / ZVD_V_percent_at_15pct", 1),
    "flex": ("5_pendulum / table6.1_m225 / flex / 0", 1),
    "stiff": ("5_pendulum / table6.1_m225 / stiff / 0", 1),
    "flex_zeta": ("5_pendulum / table6.1_m225 / flex / 1", 1),
    "stiff_zeta": ("5_pendulum / table6.1_m225 / stiff / 1", 1),
    "delay": ("3_seed001 / delay_over_T", 100),
    "mztd": ("3_seed001 / robustness_residual_quintic / -0.1 / MZTD", 1),
    "zvd_left": ("3_seed001 / robustness_residual_quintic / -0.1 / IS", 1),
    "none_left": ("3_seed001 / robustness_residual_quintic / -0.1 / none", 1),
    "zvdei": ("beyond / Figures 14-16 / zvd-ei / design 10 % low / settling_5pct_s", 1),
    "zvd10": ("beyond / Figures 14-16 / zvd / design 10 % low / settling_5pct_s", 1),
    "chords": ("beyond / document 3 / straights and chords (m)", 1),
    "p5": ("beyond / document 3 / P5, leg 1 at -90°, largest angle (°)", 1),
    "p5x": ("beyond / document 3 / P5, leg 1 at 180°, largest angle (°)", 1),
    "fir": ("4_seed004 / V_FIR_nominal / zeta.022", 100),
    "fir1": ("4_seed004 / V_FIR_nominal / zeta.1", 100),
    "zv_foot": ("beyond / document 4 / zv / last angle with a perpendicular (°)", 1),
    "zvd_foot": ("beyond / document 4 / zvd / last angle with a perpendicular (°)", 1),
}
"""What `NOT_SO` names: which row's own value, times what."""


def rows(reference: Mapping[str, Any]) -> Iterator[Row]:
    """Return all rows, in the order of the reference."""
    for name, section in SECTIONS.items():
        for row in section(reference[name]):
            yield replace(row, key=f"{name} / {row.key}")
    for row in moves.beyond_the_reference():
        yield replace(row, key=f"beyond / {row.key}")


def write_page(found: Sequence[Row]) -> str:
    """Return the page's text."""
    passed = sum(row.passed for row in found)
    parts = [HEAD, f"{passed} of {len(found)} numbers pass.\n"]
    for section, group in itertools.groupby(found, key=lambda row: row.key.split(" / ")[0]):
        parts += [f"## {TITLES[section]}\n", "\n".join(_table(group)) + "\n"]
    own = {row.key: row.ours for row in found}
    parts.append(NOT_SO.format(**{name: factor * own[key] for name, (key, factor) in NAMED.items()}))
    parts.append("## Numbers of the reference without a row\n")
    parts.append("\n".join(f"- `{part}`: {reason}" for part, reason in NOT_COMPUTED.items()) + "\n")
    return "\n".join(parts)


def missing_rows(reference: Mapping[str, Any], found: Iterable[Row]) -> list[str]:
    """Return the paths of the reference's numbers that have neither a row nor a reason."""
    keys = {row.key for row in found}
    paths = [path.removesuffix(" / got") for path in _paths(reference)]
    return [path for path in paths if path not in keys and not set(path.split(" / ")) & set(NOT_COMPUTED)]


def _paths(value: Any, *above: str) -> Iterator[str]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _paths(item, *above, key)
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from _paths(item, *above, str(i))
    elif isinstance(value, (int, float)):
        yield " / ".join(above)


def _table(group: Iterable[Row]) -> Iterator[str]:
    yield "| number | published | recomputed | ours | tolerance | pass |"
    yield "|---|---|---|---|---|---|"
    for name, members in itertools.groupby(group, key=_name):
        together = list(members)
        cells = [
            name.replace("|", "\\|"),
            _joined("-" if row.published is None else row.published for row in together),
            _joined(row.recomputed for row in together),
            _joined(row.ours for row in together),
            f"{max(row.tolerance for row in together):.1g}",
            "yes" if all(row.passed for row in together) else "**no**",
        ]
        yield f"| {' | '.join(cells)} |"


def _name(row: Row) -> str:
    """Return a row's key without its section, and without its place in a list."""
    parts = row.key.split(" / ")[1:]
    return " / ".join(parts[:-1] if parts[-1].isdigit() and len(parts) > 1 and len(parts[-1]) == 1 else parts)


def _joined(values: Iterable[Any]) -> str:
    texts = [value if isinstance(value, str) else f"{value:.7g}" for value in values]
    return texts[0] if len(set(texts)) == 1 and texts[0] == "-" else ", ".join(texts)


def main() -> int:
    """Write the page, and say what failed."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else REFERENCE
    if not path.is_file():
        sys.stderr.write(f"error: {path} is not there: give the path of acceptance.json\n")
        return 2
    reference = json.loads(path.read_text(encoding="utf-8"))
    found = list(rows(reference))
    (HERE / "numbers.md").write_text(write_page(found), encoding="utf-8")
    failed = [row.key for row in found if not row.passed]
    without = missing_rows(reference, found)
    sys.stdout.write(f"{len(found)} numbers, {len(failed)} do not pass, {len(without)} without a row\n")
    sys.stdout.write("".join(f"{key}\n" for key in failed + without))
    return 1 if failed or without else 0


if __name__ == "__main__":
    sys.exit(main())
