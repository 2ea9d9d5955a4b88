"""The pictures of docs/figures.md can be drawn anew."""

import struct
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "docs" / "draw_figures.py"
SIZES = {"ratios": (1650, 1650), "prefilters": (1650, 1200), "zero-delay": (1650, 690), "steps": (1650, 690)}


@pytest.mark.slow
def test_the_script_draws_each_picture_in_its_size(tmp_path) -> None:
    subprocess.run([sys.executable, "-W", "error", str(SCRIPT), str(tmp_path)], check=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(f"{name}.png" for name in SIZES)
    for name, size in SIZES.items():
        written = (tmp_path / f"{name}.png").read_bytes()
        assert written.startswith(b"\x89PNG\r\n\x1a\n")
        assert struct.unpack(">2I", written[16:24]) == size, name  # width and height in the header
        assert len(written) > 10_000, name
