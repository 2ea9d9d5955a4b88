"""What the user said about one measurement."""

import math
from dataclasses import dataclass
from typing import ClassVar

from tagsway.errors import InputError
from tagsway.model.estimate import FORBID_UNKNOWN
from tagsway.model.modal import Window


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The options of `identify`, checked; the defaults are the command's.

    Parameters
    ----------
    fps_hz : float or None
        Capture rate, where the file's differs.
    family : str
        Of the tags.
    tcp_id, pcp_id : int
        Tags on the tool and on the product.
    reference_id : int or None
        A tag fixed to the machine.
    tcp_tag_size_m, pcp_tag_size_m : float or None
        Side of the black square; None where it is not known.
    camera : str or None
        Path of a camera.json.
    up : str
        "image", "reference" or an angle in degrees.
    mass_kg : float or None
        Of the product.
    point_mass : bool
        States that the product is a point mass at its tag: r = l.
    length_m : float or None
        States the equivalent length l, measured by hand.
    nonnegative_stiffness : bool
        States that the gripper pushes the payload back, if at all: k ≥ 0.
    other : str or None
        result.json of another payload mass at the same arm.
    sway_axis : str or None
        "x", "z" or an angle in degrees from x; None to find it.
    window : Window or None
        The free vibration, where it is not to be found.
    frequency_spread_percent : float or None
        Standard deviation of the natural frequency between repeats.
    columns : tuple of str or None
        Names of a track's columns: time, x and perhaps z.
    shaper : str
        Type of the input shaper.
    log : str or None
        Path of a controller's log, which takes the place of the tool's tag.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    fps_hz: float | None = None
    family: str = "tag36h11"
    tcp_id: int = 0
    pcp_id: int = 1
    reference_id: int | None = None
    tcp_tag_size_m: float | None = None
    pcp_tag_size_m: float | None = None
    camera: str | None = None
    up: str = "image"
    mass_kg: float | None = None
    point_mass: bool = False
    length_m: float | None = None
    nonnegative_stiffness: bool = False
    other: str | None = None
    sway_axis: str | None = None
    window: Window | None = None
    frequency_spread_percent: float | None = None
    columns: tuple[str, ...] | None = None
    shaper: str = "zv"
    log: str | None = None

    def __post_init__(self) -> None:
        stated = {
            "--fps": (self.fps_hz, 1.0, "a capture rate in Hz", (0.01, 1e6)),
            "the TCP tag's size": (self.tcp_tag_size_m, 1000.0, "the side of its black square in mm", (0.01, 1e4)),
            "the PCP tag's size": (self.pcp_tag_size_m, 1000.0, "the side of its black square in mm", (0.01, 1e4)),
            "--mass": (self.mass_kg, 1000.0, "the product's mass in g", (1e-3, 1e9)),
            "--length": (self.length_m, 1000.0, "the equivalent length in mm", (0.01, 1e6)),
            "--frequency-spread": (self.frequency_spread_percent, 1.0, "a standard deviation in percent", (0.0, 1e3)),
        }
        for name, (value, unit, what, (low, high)) in stated.items():
            if value is not None and not (value > 0 and low <= value * unit <= high):
                extent = f", from {low:g} to {high:g}" if value > 0 and math.isfinite(value) else ""
                raise InputError(f"{name} is {value * unit:g}: expected {what}, a positive number{extent}")
        if self.other is not None and self.mass_kg is None:
            raise InputError("--with needs --mass, the mass of this product in g, beside that of the other result")
        named = [self.tcp_id, self.pcp_id, *([] if self.reference_id is None else [self.reference_id])]
        if min(named) < 0:
            raise InputError(f"tag ids are {named}: expected numbers from 0")
        if len(set(named)) != len(named):
            raise InputError(f"tag ids are {named}: TCP, PCP and reference must be different tags")
        if self.up not in ("image", "reference") and not _is_number(self.up):
            raise InputError(f"--up is {self.up!r}: expected image, reference or an angle in degrees")
        if self.up == "reference" and self.reference_id is None:
            raise InputError("--up reference needs --reference-id, the tag that is fixed to the machine")
        if self.columns is not None and (len(self.columns) not in (2, 3) or not all(self.columns)):
            raise InputError(f"--columns is {','.join(self.columns)!r}: expected the names T,X or T,X,Z")
        if self.sway_axis is not None and self.sway_axis not in ("x", "z") and not _is_number(self.sway_axis):
            raise InputError(f"--sway-axis is {self.sway_axis!r}: expected x, z or an angle in degrees")


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
