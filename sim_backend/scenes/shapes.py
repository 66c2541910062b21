"""What lies and stands on a floor as quadrilaterals: the painted line, what is painted beside it, the boxes."""

import math
from collections.abc import Iterator
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from lira.sim_backend.layout import Block, Layout, Mark
from lira.sim_backend.polyline import Floats, Polyline
from lira.sim_backend.world import Line

PAINT_STEP_M = 0.3
# Paint over paint: each layer lies this far above the one before, the line on top at height 0. The floor itself is not
# drawn, so nothing hides what is below it.
LAYER_M = 0.001
# Of two stretches of paint the directions differ by no more than rounding; and so many make one.
STRAIGHT = 1e-9
LONGEST = 8
# Corners [n, 3], and four of them for each face [m, 4]: flat, and counter-clockwise from where it is seen.
Indices = NDArray[np.intp]
Faces = tuple[Floats, Indices]
# A box's corners are numbered 4 for the larger x, 2 for the larger y and 1 for the larger z, along its own axes.
BOX_CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
# The end at the smaller x and at the larger, the side at the smaller y and at the larger, bottom and top.
BOX_FACES = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])


def paint(layout: Layout) -> Iterator[tuple[int, Faces]]:
    """Gray and faces of what is painted on a floor, each to be drawn over those before it."""
    layers = [(gray, list(alike)) for gray, alike in groupby(layout.marks, lambda mark: mark.gray)]
    for number, (gray, layer) in enumerate(layers):
        yield gray, join([mark_mesh(mark, (number - len(layers)) * LAYER_M) for mark in layer])
    line = layout.world.line
    if line is not None and line.painted:
        yield line.gray, ribbon_mesh(layout.curve, line)


def ribbon_mesh(curve: Polyline, line: Line) -> Faces:
    """One face for each stretch of the line, facing up."""
    count = max(round(curve.length_m / PAINT_STEP_M), 1)
    edges = []
    for at_m in np.linspace(0.0, curve.length_m, count + 1):
        for side in (-0.5, 0.5):
            x, y, _ = curve.pose(float(at_m), line.offset_m + side * line.width_m)
            edges.append((x, y, 0.0))
    return np.array(edges), strip(count)


def mark_mesh(mark: Mark, z_m: float) -> Faces:
    """One face for each stretch of a rectangle along its longer side, facing up."""
    lengthwise = mark.length_m >= mark.width_m
    long_m, short_m = (mark.length_m, mark.width_m) if lengthwise else (mark.width_m, mark.length_m)
    yaw_rad = mark.yaw_rad if lengthwise else mark.yaw_rad + math.pi / 2
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    count = math.ceil(long_m / PAINT_STEP_M)
    along = np.repeat(np.linspace(-0.5, 0.5, count + 1) * long_m, 2)
    across = np.tile([-0.5, 0.5], count + 1) * short_m
    x, y = mark.x_m + cos * along - sin * across, mark.y_m + sin * along + cos * across
    return np.stack([x, y, np.full_like(x, z_m)], axis=-1), strip(count)


def straighten(faces: Floats) -> Floats:
    """Join what goes on straight: the faces [n, 4, 3] of a strip as fewer of at most so many stretches, [m, 4, 3].

    A renderer likes small faces, but who counts edges is faster with large ones.
    """
    ahead, behind = faces[:, :2], faces[:, [3, 2]]  # right and left
    ways = ahead - behind
    ways /= np.sqrt((ways**2).sum(-1, keepdims=True))
    bends = (np.abs(np.diff(ways, axis=0)) > STRAIGHT).any((1, 2)) | (ahead[:-1] != behind[1:]).any((1, 2))
    begun = [0]
    for number in range(1, len(faces)):
        if bends[number - 1] or number - begun[-1] == LONGEST:
            begun.append(number)
    ends = [*begun[1:], len(faces)]
    joined = faces[begun].copy()
    joined[:, :2] = faces[np.array(ends) - 1, :2]
    return joined


def strip(count: int) -> Indices:
    """Faces of `count` stretches between pairs of corners, right and left, one pair after the other."""
    return np.array([2, 3, 1, 0]) + 2 * np.arange(count)[:, None]


def box_mesh(block: Block) -> Faces:
    """Six faces in their place, facing out."""
    along, across, up = (BOX_CORNERS * (block.length_m, block.width_m, block.height_m)).T
    cos, sin = math.cos(block.yaw_rad), math.sin(block.yaw_rad)
    x, y = block.x_m + cos * along - sin * across, block.y_m + sin * along + cos * across
    return np.stack([x, y, block.bottom_m + up], axis=-1), BOX_FACES


def join(meshes: list[Faces]) -> Faces:
    """Make one mesh of several."""
    begun = np.cumsum([0, *(len(corners) for corners, _ in meshes)])
    faces = [own + first for first, (_, own) in zip(begun.tolist(), meshes, strict=False)]
    return np.concatenate([corners for corners, _ in meshes]), np.concatenate(faces)


def obj_text(mesh: Faces) -> str:
    """Write a mesh as a Wavefront file of triangles, with every normal up."""
    corners, faces = mesh
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in corners]
    lines.append("vn 0 0 1")
    for triangle in faces[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3) + 1:
        lines.append("f " + " ".join(f"{corner}//1" for corner in triangle))
    return "\n".join(lines) + "\n"
