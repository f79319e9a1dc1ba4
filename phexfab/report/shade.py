"""Light and ink: from what a pixel sees to its colour.

The light of an overcast sky and a soft sun, each direction with a shadow map of its own, so that
what lies deep in a joint is dark and what stands free is bright. Edges are found in the picture,
where two pixels see different faces: hidden lines are hidden by construction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from phexfab.report.camera import Camera, View, fit_camera
from phexfab.report.raster import rasterise
from phexfab.report.scene import Layer

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

INK = np.array([0.10, 0.13, 0.17])
_FLOOR, _SUN_SHARE, _SKY_SHARE, _GROUND_SHARE = 0.27, 0.52, 0.48, 0.22
_SUN_SAMPLES, _SUN_RADIUS = 5, 0.06
_SHOULDER, _REST = 0.80, 0.35  # light beyond which it is dimmed, and the most that is added
_MAP = 768  # pixels across a shadow map
_BIAS = 1.5  # its pixels: how far a surface is lifted out of its own shadow
_OUTLINE, _CREASE, _SHADOW = 0.62, 0.40, 0.5  # how dark parts, faces and the ground are drawn


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
    relief: float = 1.0,
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
    relief : float
        How much of light and shade is shown; less where colours are to be read off a scale.
    """
    scene = gather(layers)
    width, height = size[0] * supersample, size[1] * supersample
    points = scene.corners.reshape(-1, 3) if framing is None else framing
    image = np.zeros((height, width, 4), np.float32)
    if len(points):
        camera = fit_camera(view, points, (width, height), margin)
        if framing is not None:  # depth counts from the nearest to the farthest that is drawn
            away = camera.distance - (scene.corners - camera.target) @ camera.axes[2]
            slack = 0.05 * camera.distance
            near = max(min(camera.near, float(away.min()) - slack), 0.02 * camera.distance)
            camera = replace(camera, near=near, far=max(camera.far, float(away.max()) + slack))
        _draw(image, scene, camera, view, lights, ground, side, supersample, relief)
    blocks = image.reshape(size[1], supersample, size[0], supersample, 4)
    return np.asarray(blocks.mean((1, 3)), np.float64)


def _draw(
    image: NDArray[np.float32],
    scene: Scene,
    camera: Camera,
    view: View,
    lights: int,
    ground: bool,
    side: str,
    supersample: int,
    relief: float,
) -> None:
    height, width = image.shape[:2]
    towards = np.einsum("ij,ij->i", scene.normals, camera.eye - scene.corners[:, 0])
    wanted = (towards > 0) | ~scene.closed
    if side != "both":
        wanted &= (towards > 0) == (side == "front")
    drawn = np.flatnonzero(wanted)
    seen, depth = rasterise(camera.project(scene.corners[drawn]), width, height)
    seen = np.where(seen >= 0, drawn[seen] if len(drawn) else -1, -1)
    pixels = np.flatnonzero(seen >= 0)
    tri = seen.ravel()[pixels]
    sky = _directions(view, lights)
    maps = _shadow_maps(scene, sky) if lights else None
    # One light sample serves all samples of a pixel that see the same triangle.
    y, x = np.divmod(pixels, width)
    block = (y // supersample) * (width // supersample) + x // supersample
    _, one, which = np.unique(block * len(scene.face) + tri, return_index=True, return_inverse=True)
    y, x, lit = y[one], x[one], tri[one]
    away = camera.away(depth.ravel()[pixels[one]])
    point = camera.eye + away[:, None] * camera.rays(x + 0.5, y + 0.5)
    normal = scene.normals[lit] * np.where(towards[lit] > 0, 1.0, -1.0)[:, None]
    light = 1 + relief * (_light(point, normal, sky, maps) - 1)
    shade = scene.colours[lit] * light[:, None]
    opaque = np.column_stack([np.minimum(shade, 1), np.ones(len(shade))]).astype(np.float32)
    image.reshape(-1, 4)[pixels] = opaque[which]
    _ink(image, scene, seen, depth)
    if ground and maps is not None and camera.axes[2, 2] > 0.05:
        _ground(image, scene, camera, sky, maps, seen < 0, 2 * supersample)


@dataclass(frozen=True, eq=False)
class _Sky:
    """Directions towards the light and the weight of each; the sun's come last."""

    towards: FloatArray
    weight: FloatArray


@dataclass(frozen=True, eq=False)
class _ShadowMaps:
    """For each light a map of how far towards it the nearest surface reaches.

    Points are measured from the maps' centre in units of a map's pixel, in single precision:
    the maps are coarser than that.
    """

    frames: NDArray[np.float32]  # (n, 3, 3): rows across, along, towards the light
    centre: FloatArray
    scale: float
    reach: list[NDArray[np.float32]]

    def place(self, points: FloatArray, normals: FloatArray | float = 0.0) -> NDArray[np.float32]:
        """Return (3, n) points of the maps' space, lifted off their surface."""
        local = (points - self.centre) * self.scale + _BIAS * normals
        return np.ascontiguousarray(local.T, np.float32)

    def shadowed(self, placed: NDArray[np.float32], k: int) -> NDArray[np.bool_]:
        """Return whether something stands between placed points and light ``k``."""
        u, v, w = self.frames[k] @ placed
        half = np.float32(_MAP / 2)
        cell = (v + half).astype(np.int32) * _MAP + (u + half).astype(np.int32)
        return np.asarray(self.reach[k].take(cell, mode="clip") > w + np.float32(_BIAS))


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


def _shadow_maps(scene: Scene, sky: _Sky) -> _ShadowMaps:
    points = scene.corners.reshape(-1, 3)
    centre = (points.min(0) + points.max(0)) / 2
    radius = float(np.linalg.norm(points - centre, axis=1).max()) or 1.0
    scale = (_MAP / 2 - 4) / radius
    frames, reach = [], []
    for d in sky.towards:
        across = np.cross(np.eye(3)[np.abs(d).argmin()], d)
        across /= np.linalg.norm(across)
        frame = np.array([across, np.cross(d, across), d])
        # Of a solid, the side turned to the light casts the whole shadow.
        casts = (scene.normals @ d > 0) | ~scene.closed
        local = (scene.corners[casts] - centre) @ frame.T * scale
        local[..., :2] += _MAP / 2
        local[..., 2] = 0.5 + local[..., 2] / _MAP
        seen, depth = rasterise(local, _MAP, _MAP)
        nearest = np.where(seen >= 0, (depth - 0.5) * _MAP, -np.inf)
        frames.append(frame)
        reach.append(nearest.astype(np.float32).ravel())
    return _ShadowMaps(np.array(frames, np.float32), centre, scale, reach)


def _light(
    point: FloatArray, normal: FloatArray, sky: _Sky, maps: _ShadowMaps | None
) -> FloatArray:
    """Return the light that reaches points of a surface with the given normals."""
    total = _FLOOR + _GROUND_SHARE * (0.5 - 0.5 * normal[:, 2])
    first = 0
    if maps is None:  # the open sky in closed form; the sun casts no shadow
        total += _SKY_SHARE * (0.5 + 0.5 * normal[:, 2])
        first = len(sky.weight) - _SUN_SAMPLES
    placed = None if maps is None else maps.place(point, normal)
    for k in range(first, len(sky.weight)):
        cosine = normal @ sky.towards[k]
        facing = np.flatnonzero(cosine > 0)
        if maps is not None and placed is not None:
            facing = facing[~maps.shadowed(placed[:, facing], k)]
        total[facing] += sky.weight[k] * cosine[facing]
    # A shoulder, as of film: what lies open to sky and sun keeps its colour, and folds still show.
    bright = np.maximum(total - _SHOULDER, 0.0)
    return np.minimum(total, _SHOULDER) + _REST * -np.expm1(-bright / _REST)


def _ink(image: NDArray[np.float32], scene: Scene, tri: IntArray, depth: FloatArray) -> None:
    """Draw outlines and edges where neighbouring pixels see different parts or faces."""
    known = tri >= 0
    face = np.where(known, scene.face[tri], -1)
    part = np.where(known, scene.part[tri], -1)
    strength = np.zeros(tri.shape, np.float32)
    for axis in (0, 1):
        a = (slice(None, -1), slice(None)) if axis == 0 else (slice(None), slice(None, -1))
        b = (slice(1, None), slice(None)) if axis == 0 else (slice(None), slice(1, None))
        line = np.where(part[a] != part[b], _OUTLINE, np.where(face[a] != face[b], _CREASE, 0.0))
        # The line lies on the nearer of the two: an outline belongs to what it bounds.
        first = depth[a] >= depth[b]
        np.maximum(strength[a], np.where(first, line, 0), out=strength[a])
        np.maximum(strength[b], np.where(first, 0, line), out=strength[b])
    pixels = np.flatnonzero(strength)
    inked = image.reshape(-1, 4)
    dark = np.append(INK, 1.0).astype(np.float32)
    inked[pixels] += strength.ravel()[pixels, None] * (dark - inked[pixels])


def _ground(
    image: NDArray[np.float32],
    scene: Scene,
    camera: Camera,
    sky: _Sky,
    maps: _ShadowMaps,
    empty: NDArray[np.bool_],
    step: int,
) -> None:
    """Lay the scene's shadow on the level of its lowest point, sampled every ``step`` pixels."""
    from scipy.ndimage import gaussian_filter

    height, width = empty.shape
    y, x = np.mgrid[0 : height + step : step, 0 : width + step : step]
    rays = camera.rays(x + 0.5, y + 0.5)
    level = scene.corners[..., 2].min()
    fall = (level - camera.eye[2]) / np.minimum(rays[..., 2], -1e-3)
    placed = maps.place((camera.eye + rays * fall[..., None]).reshape(-1, 3))
    lost = np.zeros(placed.shape[1])
    for k, d in enumerate(sky.towards):
        spot = np.abs(maps.frames[k, :2] @ placed).max(0)
        over = np.flatnonzero((spot < _MAP / 2 - 1) & (rays[..., 2] < 0).ravel())
        lost[over[maps.shadowed(placed[:, over], k)]] += sky.weight[k] * d[2]
    lost *= _SHADOW / float(sky.weight @ sky.towards[:, 2])
    # A handful of lights make terraces; a little blur makes them one soft shadow.
    soft = gaussian_filter(lost.reshape(y.shape), 1.6)
    soft = gaussian_filter(np.repeat(np.repeat(soft, step, 0), step, 1), step / 2)
    # It fades out before the picture ends: no edge of a floor shows on the page.
    across, down = (
        np.minimum(1, 10 * (0.5 - np.abs(np.linspace(-0.5, 0.5, n)))) for n in (width, height)
    )
    fade = (across**2 * (3 - 2 * across)) * (down**2 * (3 - 2 * down))[:, None]
    soft = np.where(empty, soft[:height, :width] * fade, 0)
    image[..., :3] += soft[..., None] * INK
    image[..., 3] += soft
