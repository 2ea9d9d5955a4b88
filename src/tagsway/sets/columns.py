"""What a set's tables call their columns: no factor may have one of these names."""

FIRST = ("file", "pick", "subset")
TEXTS = ("status", "error", "warnings", "rejected_by", "key")
NUMBERS = (
    "frames",
    "window_start_s",
    "window_end_s",
    "cycles",
    "natural_frequency_hz",
    "natural_frequency_std_hz",
    "damping_ratio",
    "damping_ratio_std",
    "operating_frequency_hz",
    "operating_frequency_std_hz",
    "amplitude_mm",
    "amplitude_std_mm",
    "length_mm",
    "length_std_mm",
    "tag_radius_mm",
    "tag_radius_std_mm",
    "settling_time_s",
    "overshoot_percent",
    "trajectory_time_s",
    "motion_time_s",
    "max_pcp_acceleration_m_s2",
    "max_pcp_acceleration_std_m_s2",
    "max_pcp_vector_m_s2",
    "max_pcp_vector_std_m_s2",
    "residual_max_m_s2",
    "residual_rms_m_s2",
    "place_error_mm",
    "box_error_mm",
    "reference_mm",
    "watched_s",
    "bandwidth_hz",
)
"""Columns of measurements.csv beside the factors, which stand after the first ones."""

OWN = frozenset({*FIRST, *TEXTS, *NUMBERS})
"""All of them."""

WHOLE = "(all)"
"""The subset of the summary's last row."""
