"""Files by URL, from a real server on this machine."""

import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from socket import socket
from urllib.error import URLError
from urllib.request import urlopen

import pytest

from set_files import events, inline, write_set
from tagsway.cli.app import run as run_command
from tagsway.errors import InputError
from tagsway.sets.batch import Batch, measure_set
from tagsway.sets.ledger import open_ledger
from tagsway.sets.manifest import find_set
from tagsway.sets.tables import make_tables
from tagsway.store.measurements import read_measurements

pytest.importorskip("fsspec")
pytest.importorskip("aiohttp")

PATIENCE_S = 60


@pytest.fixture
def server(tmp_path: Path) -> Iterator[str]:
    """Serve the folder `there`, and give its address."""
    write_set(tmp_path / "there", {"a": [2.0, 2.2], "b c": [2.4]})
    command = [sys.executable, "-u", "-m", "http.server", "0", "--bind", "127.0.0.1", "--directory"]
    process = subprocess.Popen([*command, str(tmp_path / "there")], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    assert process.stdout is not None
    try:
        port = process.stdout.readline().decode().split(" port ")[1].split()[0]
        address, end = f"http://127.0.0.1:{port}", time.monotonic() + PATIENCE_S
        while True:
            try:
                urlopen(address).close()
                break
            except URLError:
                assert time.monotonic() < end
                time.sleep(0.05)
        yield address
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def manifest(root: Path, *files: str) -> Path:
    root.mkdir(exist_ok=True)
    entries = "".join(f'[[measurement]]\nfile = "{file}"\nsubset = "s"\n' for file in files)
    (root / "set.toml").write_text(f'schema = "tagsway/set/1"\n{entries}')
    return root


def run(path: Path, out: Path) -> Batch:
    with open_ledger(out) as ledger:
        return measure_set(path, ledger, inline, begin=lambda *_: None, report=lambda _: None)


def test_files_of_a_server_are_measured_once_and_one_that_is_missing_costs_a_row(server, tmp_path) -> None:
    root, out = manifest(tmp_path / "set", f"{server}/a/*.csv", f"{server}/a/none.mp4"), tmp_path / "out"
    table = run(root, out).tables.measurements.set_index("file")
    assert list(table.index) == [f"{server}/a/none.mp4", f"{server}/a/r0.csv", f"{server}/a/r1.csv"]
    assert table.loc[f"{server}/a/none.mp4", "error"] == f"{server}/a/none.mp4 cannot be fetched: not found"
    assert read_measurements(out / "measurements.csv").frequency_hz == pytest.approx([2.0, 2.2], rel=1e-3)
    run(root, out)
    assert events(out, "finished") == [f"{server}/a/r0.csv", f"{server}/a/r1.csv"]
    assert events(out, "started").count(f"{server}/a/r0.csv") == 1, "its date tells that it did not change"


def test_the_same_files_from_a_server_and_from_this_machine_give_the_same_numbers(server, tmp_path) -> None:
    far = run(manifest(tmp_path / "far", f"{server}/a/r0.csv"), tmp_path / "1").tables.measurements
    shutil.copytree(tmp_path / "there", tmp_path / "near")
    near = run(manifest(tmp_path / "near", "a/r0.csv"), tmp_path / "2").tables.measurements
    assert far["natural_frequency_hz"].tolist() == near["natural_frequency_hz"].tolist()


def test_a_server_s_folder_is_a_subset_and_no_set_of_the_server_s_kind_and_may_fill_later(server, tmp_path) -> None:
    root = tmp_path / "set"
    root.mkdir()
    (root / "set.csv").write_text(f"file\n{server}/a/r0.csv\n{server}/a/*.mp4\n")
    with pytest.raises(InputError, match="matches nothing"):
        find_set(root)
    (item,) = find_set(root, may_be_empty=True).items
    assert item.subset == f"{server}/a"
    assert set(make_tables([{"file": "a", "subset": item.subset, "status": "failed"}]).summary["set"]) == {""}


@pytest.mark.skipif(find_spec("s3fs") is not None, reason="what s3 needs is installed")
def test_a_url_that_needs_something_else_says_what_to_install_and_leaves_no_folder(tmp_path, capsys) -> None:
    root = manifest(tmp_path / "set", "s3://bucket/a.mp4")
    assert run_command(["batch", str(root), "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == "error: s3://bucket/a.mp4: Install s3fs to access S3\n"
    assert not (tmp_path / "out").exists()


def test_a_url_in_the_place_of_a_set_says_where_it_belongs(capsys) -> None:
    assert run_command(["batch", "https://127.0.0.1:9/films"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: https://127.0.0.1:9/films is a URL: name the files in a set.toml")
    assert told.count("\n") == 1


def test_a_bucket_is_measured_and_listed_anew(tmp_path, monkeypatch) -> None:
    pytest.importorskip("s3fs")
    moto = pytest.importorskip("moto.server")
    boto3 = pytest.importorskip("boto3")
    with socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = moto.ThreadedMotoServer("127.0.0.1", port)
    for name, value in (
        ("ACCESS_KEY_ID", "x"),
        ("SECRET_ACCESS_KEY", "x"),
        ("ENDPOINT_URL", f"http://127.0.0.1:{port}"),
    ):
        monkeypatch.setenv(f"AWS_{name}", value)
    server.start()
    try:
        there = write_set(tmp_path / "there", {"a": [2.0, 2.2]}) / "a"
        bucket = boto3.resource("s3", region_name="us-east-1").create_bucket(Bucket="films")
        bucket.upload_file(there / "r0.csv", "a/r0.csv")
        root, out = manifest(tmp_path / "set", "s3://films/**/*.csv"), tmp_path / "out"
        run(root, out)
        bucket.upload_file(there / "r1.csv", "a/r1.csv")
        run(root, out)
    finally:
        server.stop()
    assert read_measurements(out / "measurements.csv").frequency_hz == pytest.approx([2.0, 2.2], rel=1e-3)
    assert events(out, "finished") == ["s3://films/a/r0.csv", "s3://films/a/r1.csv"]
    assert len(events(out, "started")) == 2


def test_a_server_that_does_not_answer_is_said(tmp_path) -> None:
    nowhere = "http://127.0.0.1:9"
    with pytest.raises(InputError, match="cannot be listed"):
        find_set(manifest(tmp_path / "globbed", f"{nowhere}/*.csv"))
    table = run(manifest(tmp_path / "named", f"{nowhere}/r0.csv"), tmp_path / "out").tables.measurements
    assert "cannot be fetched" in table["error"].iloc[0]
    assert table["status"].tolist() == ["failed"]
