"""What numba keeps of compiled loops."""

import os
import subprocess
import sys
from pathlib import Path

WHOLE = """
import part
from numba import types
from tagsway.compiled import compile_whole, number_sources

times = part.times

def write(sources):
    def whole(x):
        assert sources
        return times(x)
    return whole

print(compile_whole(write(number_sources(part)), (types.int64,))(7))
"""
PART = "from tagsway.compiled import compile_part\n\n@compile_part\ndef times(x):\n    return {} * x\n"


def test_what_is_compiled_along_from_another_file_is_compiled_anew_where_that_changes(tmp_path: Path) -> None:
    (tmp_path / "whole.py").write_text(WHOLE, encoding="utf-8")
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept"), "PYTHONDONTWRITEBYTECODE": "1"}
    answers, kept = [], []
    for factor in (2, 3, 3):
        (tmp_path / "part.py").write_text(PART.format(factor), encoding="utf-8")
        run = [sys.executable, str(tmp_path / "whole.py")]
        done = subprocess.run(run, env=environment, check=True, capture_output=True, text=True)
        answers.append(int(done.stdout))
        kept.append(len(list((tmp_path / "kept").rglob("*.nbc"))))
    assert answers == [14, 21, 21]
    assert kept == [1, 2, 2]  # the third run compiled nothing
