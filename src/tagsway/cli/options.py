"""Options that several commands share, so that they are called and explained alike."""

from pathlib import Path
from typing import Annotated

import typer

MoveFile = Annotated[Path, typer.Option(help="move.toml: points, heights, limits and robot.")]
Origin = Annotated[
    Path | None, typer.Option("--from", help="result.json of a measurement, or measurements.csv of many.")
]
Frequencies = Annotated[
    list[float] | None, typer.Option(help="Undamped natural frequency in Hz; again for each further mode.")
]
Dampings = Annotated[list[float] | None, typer.Option(help="Damping ratio; again for each further mode.")]
MaxPcpAcceleration = Annotated[
    float | None, typer.Option(help="Largest |x''| of the product in m/s², above which it peels off.")
]
Box = Annotated[
    float | None, typer.Option(help="Room in mm on either side of the product, below a rim of 50 mm, descent included.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
