"""Tags that a camera of known lens and tilt has seen, without a picture: corners with noise, and the truth."""

from dataclasses import dataclass

import numpy as np

from tagsway.model import FloatArray, Settings, Sightings, TagSightings, VideoInfo

WIDTH, HEIGHT = 1280, 1024
RATE_HZ = 200.0
SIZE_M, RADIUS_M, SIDE_PX = 0.03, 0.09, 60.0
SETTINGS = Settings(tcp_tag_size_m=SIZE_M, pcp_tag_size_m=SIZE_M)
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Lens:
    """One trial's camera: focal length in px, k1, and the plane's axes in the camera's, as columns."""

    focal_px: float
    radial_k1: float
    axes: FloatArray
    distance_m: float

    def show(self, point_m: FloatArray) -> FloatArray:
        """Return pixels, shape (..., 2), of points right, down and away in the plane's own axes, shape (..., 3)."""
        seen = point_m @ self.axes.T + np.array([0.0, 0.0, self.distance_m])
        plane = seen[..., :2] / seen[..., 2:]
        bent = plane * (1 + self.radial_k1 * np.sum(plane**2, axis=-1, keepdims=True))
        return self.focal_px * bent + np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2])


def rotate(axis: int, angle: FloatArray | float) -> FloatArray:
    """Return rotations about one axis, shape (..., 3, 3)."""
    a, b = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.zeros((*np.shape(angle), 3, 3))
    matrix[..., axis, axis] = 1.0
    matrix[..., a, a] = matrix[..., b, b] = np.cos(angle)
    matrix[..., a, b], matrix[..., b, a] = -np.sin(angle), np.sin(angle)
    return matrix


def see(
    tag_id: int, lens: Lens, place_m: FloatArray, axes: FloatArray, *, noise_px: float, rng: np.random.Generator
) -> TagSightings:
    """Return a tag at places right, down and away, shape (n, 3), with axes there, shape (n, 3, 3)."""
    corners = np.column_stack([CORNERS[:, 0], -CORNERS[:, 1], np.zeros(4)]) * SIZE_M / 2
    points = np.vstack([corners, np.zeros(3), [1e-4, 0, 0], [-1e-4, 0, 0]])
    shown = lens.show(points @ np.swapaxes(axes, -1, -2) + place_m[:, None])
    along = shown[:, 5] - shown[:, 6]
    count = len(place_m)
    return TagSightings(
        tag_id=tag_id,
        centre_px=shown[:, 4] + noise_px / 4 * rng.normal(size=(count, 2)),
        covariance_px2=np.tile((noise_px / 4) ** 2 * np.eye(2), (count, 1, 1)),
        corners_px=shown[:, :4] + noise_px * rng.normal(size=(count, 4, 2)),
        angle_rad=np.arctan2(-along[:, 1], along[:, 0]) + noise_px / SIDE_PX * rng.normal(size=count),
        angle_std_rad=np.full(count, noise_px / SIDE_PX),
        correlation=np.ones(count),
    )


def draw_lens(
    rng: np.random.Generator, *, tilt_deg: float = 10.0, focal_widths: tuple[float, float] = (0.9, 2.4)
) -> Lens:
    """Return a camera that sees a tag with a side of 60 px: tilts up to tilt_deg, k1 to ±0.15."""
    focal = WIDTH * float(rng.uniform(*focal_widths))
    pitch, yaw = np.radians(rng.uniform(-tilt_deg, tilt_deg, 2))
    return Lens(
        focal_px=focal,
        radial_k1=float(rng.uniform(-0.15, 0.15)),
        axes=rotate(1, yaw) @ rotate(0, pitch),
        distance_m=focal * SIZE_M / SIDE_PX,
    )


def film(
    lens: Lens,
    rng: np.random.Generator,
    *,
    span: float = 0.4,
    leaving_rad: float = 0.0,
    noise_px: float = 0.05,
    stuck_deg: float = 1.0,
) -> Sightings:
    """Return a move across a share of the image with a lift, and the product's sway.

    The product lies up to 3 % of the distance behind the tool, or before it, and both tags are stuck on out of the
    plane, by an angle about either axis. With `leaving_rad` the product also sways out of the plane and yaws, by that
    amplitude.
    """
    t = np.arange(600) / RATE_HZ
    share = np.clip((t - 0.2) / 0.8, 0, 1)
    share = share**3 * (10 - 15 * share + 6 * share**2)
    way = span * WIDTH * lens.distance_m / lens.focal_px
    tool = np.stack([way * (share - 0.5), -0.03 - 0.06 * np.sin(np.pi * share) * (span > 0), 0 * t], axis=1)
    decay = np.exp(-0.5 * t)
    sway, nod = 0.3 * decay * np.sin(4 * np.pi * t), leaving_rad * decay * np.sin(4.1 * np.pi * t + 1)
    yaw = leaving_rad * decay * np.sin(9 * np.pi * t)
    behind = rng.uniform(-0.03, 0.03) * lens.distance_m
    arm = rotate(2, -sway) @ rotate(0, nod)
    product = tool + RADIUS_M * arm[:, :, 1] + np.array([0, 0, behind])
    askew = np.radians(stuck_deg)
    stuck = [rotate(0, askew * rng.normal()) @ rotate(1, askew * rng.normal()) for _ in range(2)]
    tags = (
        see(0, lens, tool, np.tile(stuck[0], (len(t), 1, 1)), noise_px=noise_px, rng=rng),
        see(1, lens, product, arm @ rotate(1, yaw) @ stuck[1], noise_px=noise_px, rng=rng),
    )
    video = VideoInfo(
        frames=len(t),
        fps_hz=RATE_HZ,
        time_source="container",
        pts_rounding_s=0.0,
        dropped=0,
        duplicated=0,
        width=WIDTH,
        height=HEIGHT,
        duration_s=len(t) / RATE_HZ,
    )
    return Sightings(video=video, frame=np.arange(len(t)), time_s=t, tags=tags, detector_calls=1)
