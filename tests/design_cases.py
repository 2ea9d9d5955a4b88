"""The flexible subset that designs are shown on: notes on moves and the thesis' own payload."""

from tagsway.design import PayloadSpread
from tagsway.model import Limits, Mode, Move

FREQUENCY_HZ, LENGTH_M = 2.4727, 0.04585


def flexible_spread(**changes) -> PayloadSpread:
    """f_n uniform within ±11.46 % by l with k fixed, ζ from .04 to .07."""
    fields = {
        "mode": Mode(natural_frequency_hz=FREQUENCY_HZ, damping_ratio=0.055),
        "frequency_percent": 11.46,
        "damping_low": 0.04,
        "damping_high": 0.07,
        "length_m": LENGTH_M,
        "tag_radius_m": LENGTH_M,
        "shape": "uniform",
    }
    return PayloadSpread(**fields | changes)


def flexible_move(**limits) -> Move:
    """0.7 m across with 50 mm vertical at both ends, below 130 mm; the robot's vector and PCP x'' within 20 m/s²."""
    return Move(
        from_m=(-0.35, 0.0, -0.767),
        to_m=(0.35, 0.0, -0.767),
        max_acceleration_m_s2=5.0,
        pick_height_m=0.05,
        place_height_m=0.05,
        limits=Limits(
            **{
                "acceleration_m_s2": 20.0,
                "vertical_mm": 50.0,
                "pcp_acceleration_m_s2": 20.0,
                "placement_window_mm": 7.0,
                "box_m": ((-1.0, -1.0, -0.767), (1.0, 1.0, -0.637)),
            }
            | limits
        ),
    )
