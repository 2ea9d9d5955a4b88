"""Tables of other programs: each test file is made here, from the layout that the program documents."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import netcdf_file

from tagsway.errors import InputError
from tagsway.store.sources.grid import find_grids, to_number
from tagsway.store.sources.units import describe_column
from tagsway.store.tracks import read_source, track_csv

REAL = Path(__file__).parents[2] / "shared" / "data" / "real"

FREQUENCY_HZ, RATE_HZ = 1.7, 50.0
TIME = np.arange(200) / RATE_HZ
X = 0.03 * np.exp(-0.05 * TIME) * np.cos(2 * np.pi * FREQUENCY_HZ * TIME)
Z = 0.004 * np.sin(2 * np.pi * 0.3 * TIME)


def rows(*columns, delimiter=",", decimal=".", form="{:.7f}"):
    lines = (delimiter.join(form.format(v).replace(".", decimal) for v in row) for row in zip(*columns, strict=True))
    return "\n".join(lines) + "\n"


def read(tmp_path, text, *, name="track.txt", encoding="utf-8", **options):
    path = tmp_path / name
    path.write_bytes(text.encode(encoding) if isinstance(text, str) else text)
    return read_source(path, **options)


def codes(source):
    return {notice.code for notice in source.notices}


def assert_holds(source, x, z=None, *, unit="m", time=TIME):
    assert source.track.length_unit == unit
    np.testing.assert_allclose(source.track.time_s, time, atol=2e-7)  # the digits written above
    atol = 2e-7 if unit == "m" else 1e-6  # what a track is rounded to
    np.testing.assert_allclose(source.track.pcp.position[:, 0], x, atol=atol)
    if z is not None:
        np.testing.assert_allclose(source.track.pcp.position[:, 1], z, atol=atol)


@pytest.mark.parametrize("title", ["", "mass_A\n", "mass_A\t\t\n"])
def test_trackers_table_is_in_metres_with_y_up(tmp_path, title) -> None:
    source = read(tmp_path, f"{title}t\tx\ty\n" + rows(TIME, X, Z, delimiter="\t"))
    assert source.program == "Tracker"
    assert_holds(source, X, Z)
    assert codes(source) == {"unit_assumed"}


def test_trackers_units_and_further_columns_are_understood(tmp_path) -> None:
    text = "mass_A\nt (s);x (mm);y (mm);v (m/s)\n" + rows(TIME, 1e3 * X, 1e3 * Z, X, delimiter=";", decimal=",")
    source = read(tmp_path, text)
    assert_holds(source, X, Z)
    assert codes(source) == set()


def test_two_tags_are_told_by_their_names(tmp_path) -> None:
    source = read(
        tmp_path, "time (ms),tcp_x_mm,tcp_y_mm,pcp_x_mm,pcp_y_mm\n" + rows(1e3 * TIME, Z, Z, 1e3 * X, 1e3 * Z)
    )
    assert_holds(source, X, Z)
    assert source.track.tcp is not None
    np.testing.assert_allclose(source.track.tcp.position[:, 0], Z / 1e3, atol=2e-7)


@pytest.mark.parametrize(
    ("time", "step_s"),
    [([f"{t:.5f}" for t in TIME], 0.02), ([f"0:00:{int(t):02d}:{round(t % 1 * 100):02d}" for t in TIME], 0.02)],
)
def test_kinoveas_text_has_no_length_unit(tmp_path, time, step_s) -> None:
    body = "\n".join(f"{t} {x:.4f} {z:.4f}" for t, x, z in zip(time, 1e3 * X, 1e3 * Z, strict=True))
    source = read(tmp_path, f"#Kinovea Trajectory data export\n#T X Y\n\n# payload\n{body}\n\n")
    assert source.track.length_unit == "px"
    np.testing.assert_allclose(np.diff(source.track.time_s), step_s, rtol=1e-6)
    np.testing.assert_allclose(source.track.pcp.position, 1e3 * np.column_stack([X, Z]), atol=6e-5)  # four decimals


def test_kinoveas_milliseconds_and_several_trajectories(tmp_path) -> None:
    def block(name, x):
        return f"# {name}\n" + "\n".join(f"{1e3 * t:g} {v:.3f} 0,5" for t, v in zip(TIME, x, strict=True)) + "\n\n"

    text = "#Kinovea Trajectory data export\n#T X Y\n\n" + block("arm", Z) + block("Product", 1e3 * X)
    source = read(tmp_path, text.replace("\n", "\r\n"))
    np.testing.assert_allclose(source.track.time_s, TIME, atol=1e-9)
    np.testing.assert_allclose(source.track.pcp.position[:, 0], 1e3 * X, atol=6e-4)  # three decimals
    assert "several_tracks" in codes(source)


def test_time_codes_cut_to_hundredths_are_put_back_on_their_clock(tmp_path) -> None:
    time = np.arange(90) / 30
    lines = "\n".join(f"0:00:{int(t):02d}:{int(t % 1 * 100 + 1e-9):02d} {i} 0" for i, t in enumerate(time))
    source = read(tmp_path, f"#Kinovea Trajectory data export\n#T X Y\n\n# pcp\n{lines}\n")
    # discretisation: 0.01 s of cutting over 89 intervals
    np.testing.assert_allclose(np.diff(source.track.time_s), 1 / 30, rtol=2e-4)


def test_kinoveas_spreadsheet_in_xml(tmp_path) -> None:
    def row(*cells):
        return "<Row>" + "".join(f'<Cell><Data ss:Type="String">{cell}</Data></Cell>' for cell in cells) + "</Row>"

    body = "".join(row(f"{1e3 * t:.1f}", f"{x:.7f}", f"{z:.7f}") for t, x, z in zip(TIME, X, Z, strict=True))
    space = "urn:schemas-microsoft-com:office:spreadsheet"
    text = (
        f'<?xml version="1.0"?><Workbook xmlns="{space}" xmlns:ss="{space}"><Worksheet><Table>'
        f"{row('Track')}{row('Time (ms)', 'X (m)', 'Y (m)')}{body}</Table></Worksheet></Workbook>"
    )
    assert_holds(read(tmp_path, text, name="sheet.xml"), X, Z)


def deeplabcut(parts, likelihood=None):
    seen = np.full(len(TIME), 0.99) if likelihood is None else likelihood
    head = [["scorer"], ["bodyparts"], ["coords"]]
    for part in parts:
        for row, cells in zip(head, (["net"] * 3, [part] * 3, ["x", "y", "likelihood"]), strict=True):
            row += cells
    data = [np.arange(len(TIME), dtype=float)]
    for number, _ in enumerate(parts):
        data += [1e3 * X + number, 1e3 * Z, seen]
    return "\n".join(",".join(row) for row in head) + "\n" + rows(*data)


def test_deeplabcuts_unlikely_points_are_not_seen(tmp_path) -> None:
    likelihood = np.where(np.arange(len(TIME)) % 10 == 3, 0.59, 0.6)
    source = read(tmp_path, deeplabcut(["bob"], likelihood), fps_hz=RATE_HZ)
    lost = np.isnan(source.track.pcp.position[:, 0])
    np.testing.assert_array_equal(lost, likelihood < 0.6)
    assert_holds(source, np.where(lost, np.nan, 1e3 * X), np.where(lost, np.nan, -1e3 * Z), unit="px")  # down is -z
    assert codes(source) == {"no_tag_size", "points_not_seen"}


def test_deeplabcuts_points_are_told_by_name(tmp_path) -> None:
    source = read(tmp_path, deeplabcut(["tcp", "pcp"]), fps_hz=RATE_HZ)
    assert source.track.tcp is not None
    np.testing.assert_allclose(source.track.pcp.position[:, 0] - source.track.tcp.position[:, 0], 1.0, atol=1e-6)


@pytest.mark.parametrize(("parts", "fps", "word"), [(["a", "b"], 50.0, "which point"), (["bob"], None, "--fps")])
def test_a_pose_table_that_leaves_questions_asks_them(tmp_path, parts, fps, word) -> None:
    with pytest.raises(InputError, match=word):
        read(tmp_path, deeplabcut(parts), fps_hz=fps)


def movement(path, keypoints, *, unit="seconds"):
    """Write what xarray writes of movement's data set in classic netCDF: names as rows of letters."""
    with netcdf_file(path, "w") as file:
        file.fps, file.time_unit = RATE_HZ, unit
        for name, values in {"keypoints": keypoints, "individuals": ["one"], "space": ["x", "y"]}.items():
            letters = np.array([list(value.ljust(9, "\0")) for value in values], dtype="S1")
            file.createDimension(name, len(values))
            if name == "keypoints":
                file.createDimension("string9", 9)
            file.createVariable(name, "c", (name, "string9"))[:] = letters
        file.createDimension("time", len(TIME))
        file.createVariable("time", "d", ("time",))[:] = TIME if unit == "seconds" else np.arange(len(TIME))
        place = np.stack([1e3 * X, 1e3 * Z], axis=1)[:, :, None, None] + np.arange(len(keypoints))[None, None, :, None]
        file.createVariable("position", "d", ("time", "space", "keypoints", "individuals"))[:] = place
        sure = file.createVariable("confidence", "d", ("time", "keypoints", "individuals"))
        sure[:] = np.where(np.arange(len(TIME)) == 7, 0.1, 0.9)[:, None, None] * np.ones((1, len(keypoints), 1))
    return path


@pytest.mark.parametrize("unit", ["seconds", "frames"])
def test_movements_classic_netcdf_is_read(tmp_path, unit) -> None:
    source = read_source(movement(tmp_path / "poses.nc", ["pcp"], unit=unit))
    seen = np.arange(len(TIME)) != 7
    assert_holds(source, np.where(seen, 1e3 * X, np.nan), np.where(seen, -1e3 * Z, np.nan), unit="px")
    assert codes(source) == {"no_tag_size", "points_not_seen"}


def test_movements_points_are_told_by_name(tmp_path) -> None:
    source = read_source(movement(tmp_path / "poses.nc", ["product", "tool"]))
    assert source.track.tcp is not None
    np.testing.assert_allclose((source.track.tcp.position - source.track.pcp.position)[0], [1.0, -1.0], atol=1e-6)
    with pytest.raises(InputError, match="which point"):
        read_source(movement(tmp_path / "two.nc", ["a", "b"]))


def test_movements_hdf5_is_read_where_h5py_is_there(tmp_path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "poses.nc"
    with h5py.File(path, "w") as file:
        file.attrs["fps"], file.attrs["time_unit"] = [RATE_HZ], "seconds"
        scales = {"time": TIME, "space": ["x", "y"], "keypoints": ["bob"], "individuals": ["one"]}
        for name, values in scales.items():
            file.create_dataset(name, data=values).make_scale(name)
        position = file.create_dataset("position", data=np.stack([1e3 * X, 1e3 * Z], axis=1)[:, :, None, None])
        for place, name in enumerate(scales):
            position.dims[place].attach_scale(file[name])
    assert_holds(read_source(path), 1e3 * X, -1e3 * Z, unit="px")


@pytest.mark.parametrize(("delimiter", "decimal"), [(",", "."), ("\t", "."), ("\t", ","), (";", ","), (";", ".")])
@pytest.mark.parametrize("name", ["Linear Acceleration", "Acceleration"])
def test_phyphox_in_each_of_its_dialects(tmp_path, delimiter, decimal, name) -> None:
    head = delimiter.join(f'"{c}"' for c in ["Time (s)", *(f"{name} {a} (m/s^2)" for a in "xyz"), "Absolute (m/s^2)"])
    still = 9.7 if name == "Acceleration" else 0.0
    data = rows(TIME, still + 0.01 * X, X, Z, X + 10, delimiter=delimiter, decimal=decimal, form="{:.9E}")
    source = read(tmp_path, f"{head}\n{data}", name="Raw Data.csv")
    assert_holds(source, X, Z, unit="m/s2")  # the two of its axes that vary most
    assert ("acceleration_with_gravity" in codes(source)) == (name == "Acceleration")


def test_phyphox_in_german(tmp_path) -> None:
    text = "Zeit (s);Lineare Beschleunigung x (m/s²);Lineare Beschleunigung y (m/s²)\n"
    assert_holds(read(tmp_path, text + rows(TIME, X, Z, delimiter=";", decimal=",")), X, Z, unit="m/s2")


@pytest.mark.parametrize(
    ("head", "factor", "unit"),
    [
        ("t,x", 1e-3, "m"),
        ("time_s,x_mm", 1e-3, "m"),
        ("Time [s],x [cm]", 1e-2, "m"),
        ("t/s,x/m", 1.0, "m"),
        ("t_s,x_px", 1.0, "px"),
        ("time,ax", 1.0, "m/s2"),
        ("t,acc_x_g", 9.80665, "m/s2"),
        ("t,a_x (mm/s²)", 1e-3, "m/s2"),
        ("t,angle", np.pi / 180, "rad"),
        ("time_s,theta_rad", 1.0, "rad"),
        ("t,angle [°]", np.pi / 180, "rad"),
        ("t,x\ns,mm", 1e-3, "m"),
    ],
)
def test_a_plain_table_says_its_quantity_and_unit_by_its_names(tmp_path, head, factor, unit) -> None:
    assert_holds(read(tmp_path, f"{head}\n{rows(TIME, X)}"), factor * X, unit=unit)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252"])
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_marks_encodings_and_line_ends_do_not_matter(tmp_path, encoding, newline) -> None:
    text = f"Größe µ\nt;x (m)\n{rows(TIME, X, delimiter=';', decimal=',')}".replace("\n", newline)
    assert_holds(read(tmp_path, text, encoding=encoding), X)


def test_a_thousand_lines_of_header_are_passed_over(tmp_path) -> None:
    head = "".join(f"# setting {i}: value; {i}, kept\nGain {i};{i}\n" for i in range(500))
    assert_holds(read(tmp_path, f"{head}\n\nt;x (m);note\n" + rows(TIME, X, X, delimiter=";")), X)


def test_the_users_columns_win_whoever_wrote_the_table(tmp_path) -> None:
    text = "t\tx\ty\tq (cm)\n" + rows(TIME, Z, Z, 100 * X, delimiter="\t")
    assert_holds(read(tmp_path, text, columns=("t", "q")), X)


def test_frames_become_times_with_a_rate_alone(tmp_path) -> None:
    text = "frame,x_mm\n" + rows(np.arange(200.0), 1e3 * X)
    assert_holds(read(tmp_path, text, fps_hz=RATE_HZ), X)
    with pytest.raises(InputError, match="--fps"):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"\x89HDF\r\n\x1a\n" + bytes(50), "HDF5 file"),
        (b"CDF\x01" + bytes(50), "netCDF"),
        (b"PK\x03\x04" + bytes(50), "unpack"),
        (b"<KinoveaVideoAnalysis></KinoveaVideoAnalysis>", "Kinovea's own"),
        (b"<object class='org.opensourcephysics.TrackerPanel'></object>", "project file of Tracker"),
        (b"<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>", "entities"),
        (b"<a><b>", "well-formed"),
        (b"no table here\nat all\n", "no columns"),
        (b"a,b\n1,2\n3,4\n", "--columns"),
        (b"t,x,a\n", "no columns"),
        (b"t,speed (m/s)\n0,1\n1,2\n", "--columns"),
        (b"#Kinovea Trajectory data export\n#T X Y\n", "trajectory"),
        (b"t,x\nnan,1\nnan,2\n", "time column"),
    ],
)
def test_what_is_no_track_is_refused_in_one_line(tmp_path, content, word) -> None:
    with pytest.raises(InputError, match=word) as caught:
        read(tmp_path, content)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "quantity", "unit"),
    [
        ("Absolute acceleration (m/s^2)", "other", None),
        ("Gyroscope x (rad/s)", "other", None),
        ("x (kg)", "other", None),
        ("x_std_mm", "other", None),
        ("acc_x_m_s2", "acceleration", "m_s2"),
        ("Linear Acceleration x (m s^-2)", "acceleration", "m s^-2"),
        ("Timestamp", "time", None),
    ],
)
def test_a_columns_name_is_understood(name, quantity, unit) -> None:
    column = describe_column(name)
    assert column.quantity == quantity
    assert unit is None or column.unit == unit


@pytest.mark.parametrize(
    ("cell", "value"), [("1,5", 1.5), ("-.5e3", -500), ("0:00:01:25", 1.25), ("1:02:03", 3723), ("00:02.500", 2.5)]
)
def test_cells_become_numbers(cell, value) -> None:
    assert to_number(cell) == pytest.approx(value, rel=1e-12)  # identity


def test_a_missing_cell_is_nan_and_a_text_column_does_no_harm() -> None:
    (grid,) = find_grids("t,x,note\n0,1,start\n1,,\n2,NaN,end\n3,4,\n")
    np.testing.assert_array_equal(grid.values[:, 1], [1, np.nan, np.nan, 4])


@pytest.mark.skipif(not REAL.exists(), reason="the recordings are not here")
@pytest.mark.parametrize(
    ("name", "unit", "program", "n"),
    [
        ("report2_8047.txt", "m", "Tracker", 4206),
        ("report2_8051.txt", "m", "Tracker", None),
        ("film2_vga_track.csv", "px", "a table", 1844),
    ],
)
def test_real_tables_are_recognised(name, unit, program, n) -> None:
    source = read_source(REAL / name)
    assert (source.track.length_unit, source.program) == (unit, program)
    assert n is None or abs(len(source.track.time_s) - n) <= 1
    assert np.isfinite(source.track.pcp.position).all()


@pytest.mark.parametrize("head", ["t,ax", "t,angle_deg", "t,x_px", "t,x"])
def test_a_track_that_was_written_again_is_the_same_and_warns_the_same(tmp_path, head) -> None:
    first = read(tmp_path, f"{head}\n{rows(TIME, X)}")
    again = read(tmp_path, track_csv(first.track, None), name="track.csv")
    assert again.program == "tagsway"
    assert again.notices == first.notices
    np.testing.assert_array_equal(again.track.pcp.position, first.track.pcp.position)
    assert again.track.length_unit == first.track.length_unit


def test_a_column_of_degrees_takes_its_rate_from_its_header(tmp_path) -> None:
    angle = 30 * np.exp(-0.2 * np.arange(300) / 100) * np.cos(2 * np.pi * 1.5 * np.arange(300) / 100)
    file = tmp_path / "encoder.txt"
    file.write_text("start_deg, sample_rate\n30, 100\n" + "\n".join(f"{value:.4f}" for value in angle))
    track = read_source(file).track
    assert track.length_unit == "rad"
    assert track.time_s[-1] == pytest.approx(2.99)  # identity
    np.testing.assert_allclose(
        track.pcp.position[:, 0], np.radians(angle), atol=2e-6
    )  # the last digit of the file, in degrees, and of the track


def test_a_column_without_a_rate_asks_for_it(tmp_path) -> None:
    file = tmp_path / "encoder.txt"
    file.write_text("\n".join(str(k) for k in range(20)))
    with pytest.raises(InputError, match="--fps"):
        read_source(file)
    assert read_source(file, fps_hz=50.0).track.time_s[-1] == pytest.approx(0.38)  # identity
