"""Light and ink: from what a pixel sees to its colour.

The light of an overcast sky and a soft sun, each direction with a shadow map of its own, so that
what lies deep in a joint is dark and what stands free is bright. Edges are found in the picture,
where two pixels see different faces: hidden lines are hidden by construction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.report.camera import Camera, View, fit_camera
from phexfab.report.raster import rasterise
from phexfab.report.scene import Layer

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

INK = np.array([0.10, 0.13, 0.17])
_SUN_SHARE, _SKY_SHARE, _GROUND_SHARE = 0.58, 0.60, 0.16
_SUN_SAMPLES, _SUN_RADIUS = 5, 0.06
_MAP = 640  # pixels across a shadow map


@dataclass(frozen=True, eq=False)
class Scene:
    """All layers as one run of triangles.

    Attributes
    ----------
    corners : (T, 3, 3) array
    normals : (T, 3) array
    colours : (T, 3) array
    face, part : (T,) int arrays
        Numbers that are unique over all layers.
    closed : (T,) bool array
    """

    corners: FloatArray
    normals: FloatArray
    colours: FloatArray
    face: IntArray
    part: IntArray
    closed: NDArray[np.bool_]


def gather(layers: Sequence[Layer]) -> Scene:
    """Return the layers as one scene."""
    corners, colours, face, part, closed = [], [], [], [], []
    next_face = next_part = 0
    for layer in layers:
        corners.append(layer.vertices[layer.triangles])
        colours.append(layer.colours[layer.part])
        face.append(layer.face + next_face)
        part.append(layer.part + next_part)
        closed.append(np.full(len(layer.triangles), layer.closed))
        next_face += int(layer.face.max(initial=-1)) + 1
        next_part += len(layer.marks)
    points = np.concatenate([np.zeros((0, 3, 3)), *corners])
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return Scene(
        points,
        normals,
        np.concatenate([np.zeros((0, 3)), *colours]),
        np.concatenate([np.zeros(0, np.int64), *face]),
        np.concatenate([np.zeros(0, np.int64), *part]),
        np.concatenate([np.zeros(0, bool), *closed]),
    )


def picture(
    layers: Sequence[Layer],
    size: tuple[int, int],
    view: View,
    *,
    supersample: int = 2,
    lights: int = 24,
    ground: bool = False,
    margin: float = 0.04,
    side: str = "both",
    framing: FloatArray | None = None,
) -> FloatArray:
    """Return an (height, width, 4) picture, 0 to 1, colour premultiplied by its coverage.

    Parameters
    ----------
    layers : sequence of Layer
    size : (int, int)
        Width and height in pixels.
    view : View
    supersample : int
        Samples per pixel along each axis.
    lights : int
        Directions of the sky that cast shadows.
    ground : bool
        Catch the shadow on a level ground under the scene.
    margin : float
        Free border, as a fraction of the picture.
    side : str
        Of open layers, draw the ``"front"``, the ``"back"`` or ``"both"``.
    framing : (n, 3) array, optional
        Points the camera is fitted to instead of the scene's own.
    """
    scene = gather(layers)
    width, height = size[0] * supersample, size[1] * supersample
    points = scene.corners.reshape(-1, 3) if framing is None else framing
    image = np.zeros((height, width, 4))
    if len(points):
        camera = fit_camera(view, points, (width, height), margin)
        _draw(image, scene, camera, view, lights, ground, side, supersample)
    blocks = image.reshape(size[1], supersample, size[0], supersample, 4)
    return np.asarray(blocks.mean((1, 3)))


def _draw(
    image: FloatArray,
    scene: Scene,
    camera: Camera,
    view: View,
    lights: int,
    ground: bool,
    side: str,
    supersample: int,
) -> None:
    height, width = image.shape[:2]
    towards = np.einsum("ij,ij->i", scene.normals, camera.eye - scene.corners[:, 0])
    wanted = (towards > 0) | ~scene.closed
    if side != "both":
        wanted &= (towards > 0) == (side == "front")
    drawn = np.flatnonzero(wanted)
    seen, depth = rasterise(camera.project(scene.corners[drawn]), width, height)
    y, x = np.nonzero(seen >= 0)
    tri = drawn[seen[y, x]]
    away = camera.away(depth[y, x])
    normal = scene.normals[tri] * np.where(towards[tri] > 0, 1.0, -1.0)[:, None]
    point = camera.eye + away[:, None] * camera.rays(x + 0.5, y + 0.5)
    sky = _directions(view, lights)
    maps = _shadow_maps(scene, sky, lights > 0)
    light = _light(point, normal, sky, maps)
    image[y, x, :3] = np.clip(scene.colours[tri] * light[:, None], 0, 1)
    image[y, x, 3] = 1.0
    _ink(image, scene, np.where(seen >= 0, drawn[seen], -1), depth, supersample)
    if ground and lights and camera.axes[2, 2] > 0.05:
        _ground(image, scene, camera, sky, maps, seen < 0)


@dataclass(frozen=True, eq=False)
class _Sky:
    """Directions towards the light and the weight of each; the sun's come last."""

    towards: FloatArray
    weight: FloatArray


@dataclass(frozen=True, eq=False)
class _ShadowMaps:
    """For each light a map of how far towards it the nearest surface reaches."""

    frames: FloatArray  # (n, 3, 3): rows across, along, towards the light
    centre: FloatArray
    scale: float
    reach: list[FloatArray]
    bias: float


def _directions(view: View, lights: int) -> _Sky:
    """Return evenly spread directions over the upper half of the sky, and a small sun."""
    k = np.arange(lights)
    z = (k + 0.5) / max(lights, 1)
    turn = k * np.pi * (3 - np.sqrt(5)) + np.radians(view.azimuth)
    flat = np.sqrt(1 - z**2)
    sky = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    # The sun stands behind the viewer's left shoulder, whatever the view.
    right, up, back = view.axes
    sun = -0.55 * right + 0.25 * up + 0.45 * back + np.array([0, 0, 0.62])
    ring = 2 * np.pi * np.arange(_SUN_SAMPLES) / _SUN_SAMPLES
    spread = np.cos(ring)[:, None] * right + np.sin(ring)[:, None] * up
    suns = sun / np.linalg.norm(sun) + _SUN_RADIUS * spread
    suns /= np.linalg.norm(suns, axis=1, keepdims=True)
    weight = np.concatenate(
        [
            np.full(lights, 2 * _SKY_SHARE / max(lights, 1)),
            np.full(_SUN_SAMPLES, _SUN_SHARE / _SUN_SAMPLES),
        ]
    )
    return _Sky(np.concatenate([sky.reshape(-1, 3), suns]), weight)


def _shadow_maps(scene: Scene, sky: _Sky, wanted: bool) -> _ShadowMaps | None:
    if not wanted:
        return None
    points = scene.corners.reshape(-1, 3)
    centre = (points.min(0) + points.max(0)) / 2
    radius = float(np.linalg.norm(points - centre, axis=1).max()) or 1.0
    scale = (_MAP / 2 - 2) / radius
    frames, reach = [], []
    for d in sky.towards:
        across = np.cross(np.eye(3)[np.abs(d).argmin()], d)
        across /= np.linalg.norm(across)
        frame = np.array([across, np.cross(d, across), d])
        # Of a solid, the side turned to the light casts the whole shadow.
        casts = (scene.normals @ d > 0) | ~scene.closed
        local = (scene.corners[casts] - centre) @ frame.T
        local[..., :2] = local[..., :2] * scale + _MAP / 2
        local[..., 2] = 0.5 + local[..., 2] / (2.002 * radius)
        seen, depth = rasterise(local, _MAP, _MAP)
        nearest = np.where(seen >= 0, (depth - 0.5) * 2.002 * radius, -np.inf)
        frames.append(frame)
        reach.append(nearest.astype(np.float32).ravel())
    return _ShadowMaps(np.array(frames), centre, scale, reach, 1.6 / scale)


def _light(
    point: FloatArray, normal: FloatArray, sky: _Sky, maps: _ShadowMaps | None
) -> FloatArray:
    """Return the light that reaches points of a surface with the given normals."""
    total = _GROUND_SHARE * (0.5 - 0.5 * normal[:, 2]) + 0.10
    if maps is None:
        total = total + _SKY_SHARE * (0.5 + 0.5 * normal[:, 2])
    sunny = len(sky.weight) - _SUN_SAMPLES
    lit = point if maps is None else point - maps.centre + maps.bias * normal
    for k in range(0 if maps is not None else sunny, len(sky.weight)):
        cosine = normal @ sky.towards[k]
        share = sky.weight[k] * np.maximum(cosine, 0)
        if maps is not None:
            facing = np.flatnonzero(share)
            dark = facing[_shadowed(lit[facing], maps, k)]
            share[dark] = 0
        total = total + share
    return total


def _shadowed(offset: FloatArray, maps: _ShadowMaps, k: int) -> NDArray[np.bool_]:
    """Return whether something stands between points (from the maps' centre) and light k."""
    local = offset @ maps.frames[k].T
    cell = np.clip(local[:, :2] * maps.scale + _MAP / 2, 0, _MAP - 1).astype(np.int64)
    return np.asarray(maps.reach[k][cell[:, 1] * _MAP + cell[:, 0]] > local[:, 2] + maps.bias)


def _ink(
    image: FloatArray, scene: Scene, tri: IntArray, depth: FloatArray, supersample: int
) -> None:
    """Draw outlines and edges where neighbouring pixels see different parts or faces."""
    known = tri >= 0
    face = np.where(known, scene.face[tri], -1)
    part = np.where(known, scene.part[tri], -1)
    strength = np.zeros(tri.shape)
    for axis in (0, 1):
        a: tuple[slice, slice] = (slice(None), slice(None, -1)) if axis else (slice(None, -1), slice(None))
        b: tuple[slice, slice] = (slice(None), slice(1, None)) if axis else (slice(1, None), slice(None))
        crease = np.where(face[a] != face[b], 0.42, 0.0)
        outline = np.where(part[a] != part[b], 0.62, 0.0)
        line = np.maximum(crease, outline)
        # The line lies on the nearer of the two: an outline belongs to what it bounds.
        first = depth[a] >= depth[b]
        strength[a] = np.maximum(strength[a], np.where(first, line, 0))
        strength[b] = np.maximum(strength[b], np.where(first, 0, line))
    image[..., :3] += strength[..., None] * known[..., None] * (INK - image[..., :3])


def _ground(
    image: FloatArray,
    scene: Scene,
    camera: Camera,
    sky: _Sky,
    maps: _ShadowMaps | None,
    empty: NDArray[np.bool_],
) -> None:
    """Lay the scene's shadow on the level of its lowest point."""
    if maps is None:
        return
    height, width = empty.shape
    step = 2  # the shadow is soft: every other pixel is enough
    y, x = np.mgrid[0:height:step, 0:width:step]
    rays = camera.rays(x + 0.5, y + 0.5)
    level = scene.corners[..., 2].min()
    fall = np.minimum(rays[..., 2], -1e-3)
    point = camera.eye + rays * ((level - camera.eye[2]) / fall)[..., None]
    radius = (_MAP / 2 - 2) / maps.scale
    offset = (point - maps.centre).reshape(-1, 3)
    offset[:, 2] += maps.bias
    near = np.flatnonzero((np.hypot(offset[:, 0], offset[:, 1]) < 3 * radius) & (rays[..., 2] < 0).ravel())
    full = float((sky.weight * sky.towards[:, 2]).sum())
    lost = np.zeros(len(offset))
    for k, d in enumerate(sky.towards):
        inside = np.abs(offset[near] @ maps.frames[k, :2].T).max(1) < radius
        reached = near[inside]
        dark = reached[_shadowed(offset[reached], maps, k)]
        lost[dark] += sky.weight[k] * d[2]
    shadow = (0.55 * lost / full).reshape(y.shape)
    soft = np.repeat(np.repeat(shadow, step, 0), step, 1)[:height, :width]
    image[..., :3] += np.where(empty, soft, 0)[..., None] * INK
    image[..., 3] += np.where(empty, soft, 0)
