"""Every number of the four documents, against an independent implementation: docs/numbers.md, as a test."""

import json
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def numbers():
    sys.path.insert(0, str(DOCS))
    try:
        import compare_numbers
    finally:
        sys.path.remove(str(DOCS))
    return compare_numbers


@pytest.fixture(scope="module")
def reference(shared) -> dict:
    return json.loads((shared / "notes" / "acceptance.json").read_text())


@pytest.fixture(scope="module")
def found(numbers, reference) -> list:
    return list(numbers.rows(reference))


def test_every_number_is_the_recomputed_one(found) -> None:
    assert len(found) > 480
    assert [f"{row.key}: {row.ours:.9g}, not {row.recomputed:.9g}" for row in found if not row.passed] == []


def test_no_number_of_the_reference_is_left_out(numbers, reference, found) -> None:
    assert numbers.missing_rows(reference, found) == []


def test_a_wrong_number_does_not_pass_and_a_missing_one_is_named(numbers, reference, found) -> None:
    from dataclasses import replace

    row = found[0]
    assert not replace(row, ours=row.ours + 1.01 * row.tolerance + abs(row.ours - row.recomputed)).passed
    assert not replace(row, ours=float("nan")).passed
    assert numbers.missing_rows(reference, found[1:]) == [row.key]


def test_the_page_holds_every_number(numbers, found) -> None:
    page = numbers.write_page(found)
    assert page.count("**no**") == 0
    written = (DOCS / "numbers.md").read_text(encoding="utf-8")
    assert [line.split("|")[1] for line in written.splitlines() if line.startswith("| ")] == [
        line.split("|")[1] for line in page.splitlines() if line.startswith("| ")
    ]
