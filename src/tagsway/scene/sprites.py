"""What is to be seen in a scene: flat things that carry a tag, and the wall behind them."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tagsway.model import FloatArray
from tagsway.scene.model import Scene, Tag, TagName
from tagsway.scene.optics import Picture
from tagsway.tags.draw import cover_tag
from tagsway.tags.families import tag_family

ImageArray = NDArray[np.float32]

TEXELS_PER_PX = 8
"""OpenCV looks a texture up to 1/32 of a texel: finer texels keep that below 0.002 px."""

LARGEST_TEXTURE = 4096
"""Texels a side; things that fill the picture get coarser ones."""

BODY_GREY, TOOL_GREY, WALL_GREY, TABLE_GREY, COVER_GREY, NECK_GREY = 118.0, 78.0, 172.0, 148.0, 100.0, 54.0
QUIET_CELLS = 0.75


@dataclass(frozen=True, slots=True, kw_only=True)
class Sprite:
    """A flat thing with a tag, already blurred by the lens.

    Parameters
    ----------
    texture : ndarray of float32, shape (rows, columns, 2)
        Grey times opacity, and opacity; row 0 is the top.
    texel_m : float
        Side of a texel.
    left_m, top_m : float
        Of the texture's outer corner, from the tag's centre; x right, z up.
    """

    texture: ImageArray
    texel_m: float
    left_m: float
    top_m: float

    @property
    def corners_m(self) -> FloatArray:
        """Its corners about the tag's centre, shape (4, 2)."""
        rows, columns = self.texture.shape[:2]
        right, bottom = self.left_m + columns * self.texel_m, self.top_m - rows * self.texel_m
        return np.array([[self.left_m, bottom], [right, bottom], [right, self.top_m], [self.left_m, self.top_m]])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Box:
    """A rectangle with round corners, about the tag's centre, in metres; `grey` of the box."""

    left: float
    right: float
    bottom: float
    top: float
    radius: float
    grey: float


def make_sprite(scene: Scene, name: TagName, tag: Tag, m_per_px: float, *, covered: float = 0.0) -> Sprite:
    """Return a tag with what carries it.

    Parameters
    ----------
    scene : Scene
        For the family, the greys and the blur.
    name : {"tcp", "pcp", "reference"}
        What it is the tag of.
    tag : Tag
        The tag.
    m_per_px : float
        Scale where it is seen; the lens' blur is a length in pixels.
    covered : float
        Share of the width that something hides, from the left.
    """
    picture = scene.picture
    family = tag_family(scene.tags.family)
    paper = tag.size_m * (family.cells + 2 * QUIET_CELLS) / family.border_cells / 2
    boxes = _boxes_of(scene, name, paper)
    if covered > 0:
        half = 1.15 * paper
        boxes.append(
            _Box(left=-half, right=half * (2 * covered - 1), bottom=-half, top=half, radius=0, grey=COVER_GREY)
        )
    margin = 5 * picture.blur_px * m_per_px
    left, right = min(b.left for b in boxes) - margin, max(b.right for b in boxes) + margin
    bottom, top = min(b.bottom for b in boxes) - margin, max(b.top for b in boxes) + margin
    texel = max(m_per_px / TEXELS_PER_PX, max(right - left, top - bottom) / LARGEST_TEXTURE)
    x = np.asarray(left + texel * np.arange(int(np.ceil((right - left) / texel)) + 1), dtype=np.float64)
    z = np.asarray(top - texel * np.arange(int(np.ceil((top - bottom) / texel)) + 1), dtype=np.float64)
    texture = np.zeros((len(z) - 1, len(x) - 1, 2), dtype=np.float32)
    last = len(boxes) - (covered > 0)
    for box in boxes[:last]:
        _lay(texture, _opacity(box, x, z), box.grey)
    white = cover_tag(scene.tags.family, tag.id, x / (tag.size_m / 2), z / (tag.size_m / 2))
    sheet = _Box(left=-paper, right=paper, bottom=-paper, top=paper, radius=0.0, grey=0.0)
    _lay(texture, _opacity(sheet, x, z), picture.black_grey + (picture.white_grey - picture.black_grey) * white)
    for box in boxes[last:]:
        _lay(texture, _opacity(box, x, z), box.grey)
    blurred = cv2.GaussianBlur(texture, (0, 0), picture.blur_px * m_per_px / texel, borderType=cv2.BORDER_CONSTANT)
    return Sprite(texture=_float32(blurred), texel_m=texel, left_m=left, top_m=top)


def draw_wall(picture: Picture, width: int, height: int, rng: np.random.Generator) -> ImageArray:
    """Return what is behind everything, shape (height, width): a wall, a table, squares that are no tags."""
    rows = np.linspace(1.04, 0.96, height, dtype=np.float32)[:, None]
    wall: Any = WALL_GREY * rows * np.ones((1, width), dtype=np.float32)
    wall[round(0.93 * height) :] = TABLE_GREY
    for _ in range(picture.decoys):
        side = rng.uniform(0.03, 0.12) * width
        centre, turn = rng.uniform((0, 0), (width, height)), rng.uniform(0, np.pi / 2)
        ink, paper = rng.uniform(20, 80), rng.uniform(150, 230)
        for share, grey in ((1.3, paper), (1.0, ink), (rng.uniform(0.3, 0.7), paper)):
            angles = turn + np.pi / 4 + np.pi / 2 * np.arange(4)
            corners = centre + share * side / np.sqrt(2) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
            cv2.fillConvexPoly(wall, np.rint(16 * corners).astype(np.int32), float(grey), cv2.LINE_AA, 4)
    if picture.texture_grey > 0:
        rough = cv2.GaussianBlur(rng.standard_normal((height, width), dtype=np.float32), (0, 0), 1.5)
        wall += rough * np.float32(picture.texture_grey / float(np.std(rough)))
    return _float32(cv2.GaussianBlur(wall, (0, 0), picture.blur_px))


def _boxes_of(scene: Scene, name: TagName, paper: float) -> list[_Box]:
    """Return what carries a tag, from back to front; `paper` is half the side of its sheet."""
    if name == "pcp":
        half, up = 1.25 * paper, scene.payload.pendulum().tag_radius_m
        strap = _Box(left=-0.08 * paper, right=0.08 * paper, bottom=0.0, top=up, radius=0.04 * paper, grey=NECK_GREY)
        return [strap, _Box(left=-half, right=half, bottom=-half, top=half, radius=0.35 * paper, grey=BODY_GREY)]
    half = 1.12 * paper
    plate = _Box(left=-half, right=half, bottom=-half, top=half, radius=0.15 * paper, grey=TOOL_GREY)
    if name == "reference":
        return [plate]
    x, z = scene.tool.pivot_offset_m
    neck = _Box(
        left=x - 0.3 * paper,
        right=x + 0.3 * paper,
        bottom=min(z, 0.0),
        top=max(z, 0.0),
        radius=0.05 * paper,
        grey=NECK_GREY,
    )
    return [neck, plate]


def _opacity(box: _Box, x_edges: FloatArray, z_edges: FloatArray) -> FloatArray:
    """Return how much of each texel a box covers, from the signed distance of the texel's middle to its outline."""
    x, z = (x_edges[:-1] + x_edges[1:]) / 2, (z_edges[:-1] + z_edges[1:]) / 2
    across = np.abs(x - (box.left + box.right) / 2) - (box.right - box.left) / 2 + box.radius
    along = np.abs(z - (box.bottom + box.top) / 2) - (box.top - box.bottom) / 2 + box.radius
    outside = np.hypot(np.maximum(across, 0.0)[None, :], np.maximum(along, 0.0)[:, None])
    inside = np.minimum(np.maximum(across[None, :], along[:, None]), 0.0)
    texel = float(x_edges[1] - x_edges[0])
    opacity: FloatArray = np.clip(0.5 - (outside + inside - box.radius) / texel, 0.0, 1.0)
    return opacity


def _lay(texture: ImageArray, opacity: FloatArray, grey: FloatArray | float) -> None:
    texture *= (1 - opacity[:, :, None]).astype(np.float32)
    texture[:, :, 0] += (opacity * grey).astype(np.float32)
    texture[:, :, 1] += opacity.astype(np.float32)


def _float32(image: Any) -> ImageArray:
    return np.ascontiguousarray(image, dtype=np.float32)
