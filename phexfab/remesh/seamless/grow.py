"""The lattice of a whole domain, closed up around its umbilics.

The lattice points of w̃ are found chart by chart; the neighbours of a point are found by following
straight steps of w̃ from chart to chart. Nothing depends on a way through the domain but the charts'
offsets, and the seamless coordinate makes those agree to rounding on all ways.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order
from scipy.spatial import cKDTree

from phexfab.errors import LatticeError
from phexfab.remesh.lattice import Lattice
from phexfab.remesh.seamless.charts import Atlas, build_atlas
from phexfab.remesh.seamless.coordinate import Seamless, seamless
from phexfab.remesh.stars import around_panels, star_triangles
from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import ComplexArray, show
from phexfab.surface.umbilics import Umbilics
from phexfab.surface.weierstrass import MinimalSurface
from phexfab.triangular import EQUILATERAL

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MOST_HOPS = 200
SHORTEST_HOP = 1.0 / 256
EDGE = 1e-6  # of a chart's square: points that near to its border count for both sides
SAME = 1e-4  # of a step: lattice points nearer than that are one


def grow_lattice(
    surface: MinimalSurface,
    domain: Disc,
    *,
    panel_size: float,
    row_ratio: float = EQUILATERAL,
    rows_along: str = "u",
    evenness: float = 0.0,
    kind: str = "face",
    core: Disc | None = None,
    found: Umbilics | None = None,
    trim: bool = True,
) -> Lattice:
    """Return the lattice whose points fill a plane domain of parameters, umbilics included.

    Parameters
    ----------
    surface : MinimalSurface
    domain : Disc
        A disc in z, with round holes or without.
    panel_size, row_ratio, rows_along, evenness, kind, core, found
        See ``seamless``.
    trim : bool
        Leave out panels beside an umbilic whose own panel the border cuts off; False for what is
        cut along a rim later.

    Returns
    -------
    Lattice
        ``points`` and ``parameters`` are z. A panel at an umbilic of order m has 3 (m + 2) sides.

    Raises
    ------
    LatticeError
        If the umbilics are too near to each other for panels of this size, or no panel fits.
    SurfaceError
        If there is a branch point or an end in the domain.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper", order=2).scaled(5000.0)  # an umbilic at 0
    >>> on = px.grow_lattice(surface, px.Disc(0, 0.9), panel_size=900.0)
    >>> mesh = px.minimal_shell(surface, on).mesh
    >>> mesh.n_faces, int(mesh.sides.max())  # nine sides at the umbilic
    (10, 9)
    """
    return lattice_of(
        seamless(
            surface,
            domain,
            panel_size=panel_size,
            row_ratio=row_ratio,
            rows_along=rows_along,
            evenness=evenness,
            kind=kind,
            core=core,
            found=found,
        ),
        trim,
    )


def lattice_of(on: Seamless, trim: bool = True) -> Lattice:
    """Return the lattice of a seamless coordinate, see ``grow_lattice``."""
    atlas = build_atlas(on.quantity, on.domain, on.apices.places, on.apices.orders)
    offset = _offsets(on, atlas)
    z, chart = _points(on, atlas, offset)
    start, goal, sector, valence = _neighbours(on, atlas, z, chart)
    triangles = star_triangles(start, goal, sector, valence, len(z))
    triangles = around_panels(triangles, valence, trim)
    if not len(triangles):
        raise LatticeError(
            f"{on.surface.name}: no panel fits the domain at panels of about "
            f"{on.sizes[1]:.4g} mm: choose a smaller lattice.panel_size or a larger domain"
        )
    used = np.unique(triangles)
    used = used[_order(z[used], on)]
    index = np.full(len(z), -1)
    index[used] = np.arange(len(used))
    triangles = index[triangles]
    triangles = triangles[np.lexsort(triangles.T[::-1])]
    _check(on, z[used], triangles, valence[used])
    # An apex that has left its umbilic would have density 0: the panel there stands for both.
    log_density = on.correction(z[used]).real
    plain = used >= len(on.apices)
    log_density[plain] = on.log_density(z[used[plain]]).real
    return Lattice(
        z[used],
        triangles,
        np.ones(len(triangles), bool),
        on.plane.step,
        on.plane.row_ratio,
        bool(on.domain.holes),
        z[used],
        np.exp(log_density),
    )


# -- offsets of the charts -----------------------------------------------------------------------


def _offsets(on: Seamless, atlas: Atlas) -> ComplexArray:
    """Return o of every chart, so that its lattice points are where w̃ + o is a lattice vector."""
    n, k = len(atlas.centre), len(on.apices)
    first, second, at = atlas.squares.contacts(on.domain)
    w1, v1 = atlas.coordinate(first, at)
    w2, v2 = atlas.coordinate(second, at)
    sign = np.where((v1 * v2.conj()).real < 0, -1.0, 1.0)
    offset = np.full(n, np.nan + 0j)
    offset[:k] = 0.0
    if not k:
        base = atlas.chart_at(np.array([on.anchor]))
        w, v = atlas.coordinate(base, np.array([on.anchor]))
        principal = np.sqrt(on.quantity(np.array([on.anchor])))
        side = np.where((v * principal.conj()).real < 0, -1.0, 1.0)
        offset[base] = side * on.shift - w
    # All known charts hang on one more node, the root of a breadth-first tree.
    known = np.flatnonzero(np.isfinite(offset))
    a = np.concatenate([first, np.full(len(known), n)])
    b = np.concatenate([second, known])
    row = np.concatenate([np.arange(len(first)), np.full(len(known), -1)])
    graph = sp.coo_matrix((np.ones(len(a)), (a, b)), shape=(n + 1, n + 1)).tocsr()
    order, parent = breadth_first_order(graph, n, directed=False)
    key = {(int(p), int(q)): int(r) for p, q, r in zip(a, b, row, strict=True)}
    for c in order[1:]:
        if np.isfinite(offset[c]):
            continue
        p = int(parent[c])
        e, forward = (key[p, c], True) if (p, c) in key else (key[c, p], False)
        wp, wc = (w1[e], w2[e]) if forward else (w2[e], w1[e])
        moved = sign[e] * (wp + offset[p])
        offset[c] = on.plane.remainder(moved) - wc
    gap = on.plane.remainder(sign * (w1 + offset[first]) - (w2 + offset[second]))
    gap = np.abs(gap[np.isfinite(gap)])
    if len(gap) and gap.max() > 1e-6 * on.plane.step:
        worst = show(complex(at[np.isfinite(offset[first] + offset[second])][gap.argmax()]))
        raise LatticeError(
            f"{on.surface.name}: the lattice misses itself by {gap.max() / on.plane.step:.1e} of a "
            f"step near z = {worst}: the Hopf differential is not resolved there; choose a "
            "slightly smaller domain"
        )
    return offset


# -- points --------------------------------------------------------------------------------------


def _points(on: Seamless, atlas: Atlas, offset: ComplexArray) -> tuple[ComplexArray, IntArray]:
    """Return all lattice points in the domain and their charts; the umbilics come first."""
    k = len(on.apices)
    owned = np.unique(atlas.squares.owner)
    charts, taus = [np.zeros(0, np.int64)], [np.zeros(0, complex)]
    circle = np.exp(2j * np.pi * np.arange(48) / 48)
    reach_in = np.where(np.isfinite(atlas.half), atlas.half * np.sqrt(2) * 1.001, atlas.trust)
    tau, _ = atlas.tau(
        np.repeat(owned, 48),
        (atlas.centre[owned, None] + reach_in[owned, None] * circle).ravel(),
    )
    reach = np.abs(tau).reshape(-1, 48).max(1)
    for c, far in zip(owned, reach, strict=True):
        if not np.isfinite(offset[c]):
            continue  # beside the domain: reached by no way inside
        p = atlas.power[c]
        w = on.plane.around(offset[c], far**p) - offset[c]
        if p == 1.0:
            mine = w
        else:
            w = w[np.abs(w) > 0.1 * on.plane.step]
            angle = np.angle(w) % (2 * np.pi)
            sheets = angle[:, None] + 2 * np.pi * np.arange(int(np.ceil(p)))
            size = np.broadcast_to(np.abs(w)[:, None], sheets.shape)
            real = sheets < 2 * np.pi * p - 1e-9
            mine = size[real] ** (1 / p) * np.exp(1j * sheets[real] / p)
        charts.append(np.full(len(mine), c))
        taus.append(mine)
    chart, tau = np.concatenate(charts), np.concatenate(taus)
    z, good = atlas.place(chart, tau)
    good &= on.domain.contains(z)
    good[good] = _owns(atlas, chart[good], z[good])
    z = np.concatenate([on.apices.places, z[good]])
    chart = np.concatenate([np.arange(k), chart[good]])
    if len(z) == k:
        return z, chart
    _, speed = atlas.coordinate(chart[k:], z[k:])
    room = on.plane.step / np.abs(speed).max(initial=1e-300)
    pairs = cKDTree(np.column_stack([z.real, z.imag])).query_pairs(
        SAME * room, output_type="ndarray"
    )
    first = np.ones(len(z), bool)
    first[pairs.max(1)] = False
    return z[first], chart[first]


def _owns(atlas: Atlas, chart: IntArray, z: ComplexArray) -> NDArray[np.bool_]:
    """Return whether places belong to their chart, those on its border included."""
    away = z - atlas.centre[chart]
    half = atlas.half[chart]
    square = np.isfinite(half)
    near = np.maximum(np.abs(away.real), np.abs(away.imag)) <= half * (1 + EDGE)
    for nudge in (0, 1, -1, 1j, -1j):
        todo = np.flatnonzero(~square)
        at = z[todo] + nudge * EDGE * atlas.trust[chart[todo]]
        square[todo] = atlas.chart_at(at) == chart[todo]
    return near & square


# -- neighbours ----------------------------------------------------------------------------------


def _neighbours(
    on: Seamless, atlas: Atlas, z: ComplexArray, chart: IntArray
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return (start, goal, sector) of all steps to known points, and the full valence of each.

    Sectors count the neighbours counter-clockwise; sector 0, 3, 6 … run along a row.
    """
    k = len(on.apices)
    vectors = on.plane.neighbours
    valence = np.full(len(z), 6)
    valence[:k] = 3 * (on.apices.orders + 2)
    start = np.repeat(np.arange(len(z)), valence)
    sector = np.arange(len(start)) - np.repeat(np.cumsum(valence) - valence, valence)
    left = vectors[sector % 6].copy()
    here, own = z[start], chart[start]
    _, speed = atlas.coordinate(own, here)
    if k:
        # From an umbilic: out along the rays of the cone, as far as its chart holds.
        rays = start < k
        p, size = atlas.power[own[rays]], np.abs(left[rays])
        first = vectors[0]
        angle = np.angle(first) + np.angle(left[rays] / first) % (2 * np.pi)
        angle += 2 * np.pi * (sector[rays] // 6)
        share = np.ones(rays.sum())
        for _ in range(60):
            tau = (share * size) ** (1 / p) * np.exp(1j * angle / p)
            there, good = atlas.place(own[rays], tau)
            if good.all():
                break
            share = np.where(good, share, 0.5 * share)
        here[rays] = there
        w, v = atlas.coordinate(own[rays], there)
        left[rays], speed[rays] = w * (1 - share) / share, v
        # On the rim of the umbilic's chart there is no going on but in the next one.
        beyond = atlas.chart_at(there)
        own[rays] = np.where(beyond < 0, own[rays], beyond)
    end, arrived = _follow(atlas, here, own, speed, left, on.plane.step)
    known = cKDTree(np.column_stack([z.real, z.imag]))
    distance, goal = known.query(np.column_stack([end.real, end.imag]))
    hop = np.abs(end - z[start])
    hit = arrived & (distance <= 1e-3 * hop) & (goal != start)
    return start[hit], goal[hit], sector[hit], valence


def _follow(
    atlas: Atlas,
    z: ComplexArray,
    chart: IntArray,
    speed: ComplexArray,
    left: ComplexArray,
    step: float,
) -> tuple[ComplexArray, NDArray[np.bool_]]:
    """Return where straight ways in w̃ lead, and which of them stay inside the atlas.

    Parameters
    ----------
    z, chart : (n,) places and their charts
    speed : (n,) dw̃/dz on the root on which ``left`` is meant
    left : (n,) the vectors to go
    step : float
        The lattice's, to tell when a way ends in an umbilic.
    """
    z, chart, speed, left = z.copy(), chart.copy(), speed.copy(), left.copy()
    share = np.ones(len(z))
    done = np.abs(left) <= 1e-12 * step
    todo = np.flatnonzero(~done)
    for _ in range(MOST_HOPS):
        if not len(todo):
            break
        c = chart[todo]
        w, v = atlas.coordinate(c, z[todo])
        flip = np.where((v * speed[todo].conj()).real < 0, -1.0, 1.0)
        target = w + share[todo] * flip * left[todo]
        p = atlas.power[c]
        tau = target.copy()
        bent = np.flatnonzero(p != 1.0)
        tau_here, _ = atlas.tau(c[bent], z[todo[bent]])
        with np.errstate(all="ignore"):
            turned = tau_here * (target[bent] / w[bent]) ** (1 / p[bent])
        tau[bent] = np.where(np.abs(target[bent]) < 1e-7 * step, 0.0, turned)
        there, good = atlas.place(c, tau)
        whole = good & (share[todo] == 1.0)
        part = good & ~whole
        z[todo[good]] = there[good]
        done[todo[whole]] = True
        on_way = todo[part]
        left[on_way] *= 1 - share[on_way]
        # About an umbilic the principal power may have changed its sign on the way.
        reached, new = atlas.coordinate(c[part], there[part])
        other = (p[part] != 1.0) & ((reached * target[part].conj()).real < 0)
        speed[on_way] = flip[part] * np.where(other, -new, new)
        chart[on_way] = atlas.chart_at(z[on_way])
        share[on_way] = 1.0
        share[todo[~good]] *= 0.5
        lost = (share[todo] < SHORTEST_HOP) | (chart[todo] < 0)
        todo = todo[~whole & ~lost]
    return z, done


def _order(z: ComplexArray, on: Seamless) -> IntArray:
    """Return an order in rings about the first umbilic, or the centre of the domain."""
    middle = on.apices.places[0] if len(on.apices) else on.domain.centre
    arm = (z - middle) * np.exp(-0.05j)
    ring = np.abs(arm) / on.domain.radius * np.sqrt(len(z) / np.pi)
    return np.lexsort((np.angle(arm), np.round(ring)))


def _check(on: Seamless, z: ComplexArray, triangles: IntArray, valence: IntArray) -> None:
    """Refuse a lattice that is no disc, or no disc with these holes."""
    n = len(z)
    a, b = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    directed = a * n + b
    edges = np.unique(np.minimum(a, b) * n + np.maximum(a, b))
    euler = n - len(edges) + len(triangles)
    wanted = 1 - len(on.domain.holes)
    if len(np.unique(directed)) < len(directed) or euler != wanted:
        what = (
            "a hole is too small for panels of this size, or panels do not get around it"
            if on.domain.holes
            else "panels are too large for this domain"
        )
        raise LatticeError(
            f"{on.surface.name}: the lattice is not a disc with {len(on.domain.holes)} holes "
            f"(Euler characteristic {euler}, not {wanted}): {what}; choose a smaller "
            "lattice.panel_size"
        )
