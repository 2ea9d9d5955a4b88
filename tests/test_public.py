"""What `import tagsway` gives."""

import subprocess
import sys

import pytest

import tagsway


@pytest.mark.parametrize("name", tagsway.__all__)
def test_every_public_name_is_there_and_says_what_it_is(name) -> None:
    assert getattr(tagsway, name).__doc__


def test_the_import_itself_loads_nothing_heavy() -> None:
    code = "import sys, tagsway; print(sorted({m.split('.')[0] for m in sys.modules} & {'cv2', 'scipy', 'numpy'}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'colour'"):
        _ = tagsway.colour
