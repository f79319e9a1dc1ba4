"""Planar quad meshes: optimisation and subdivision in turns, from principal curves.

A coarse mesh of principal curves is nearly planar, circular and conical. It is made exactly so,
subdivided, drawn back onto the surface and made so again, until faces are small enough.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import LatticeError, MeshError, SolveError
from phexfab.linalg import factorise
from phexfab.mesh.measures import mean_edge, planarity, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.classify import circularity, conicality
from phexfab.remesh.conjugate.base import base_curves, even
from phexfab.remesh.conjugate.fields import Family, principal_family
from phexfab.remesh.conjugate.net import conjugate_net
from phexfab.remesh.planarity.hold import BorderCurve, Hold
from phexfab.remesh.planarity.nearest import FreeformReference, Reference, as_reference
from phexfab.remesh.quads.rows import QuadRows
from phexfab.remesh.quads.subdivide import subdivided
from phexfab.surface.freeform.surface import FreeformSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

EXACT = 1e-10
"""Planarity over the mean edge, circularity and conicality to reach."""
PULLS = 10  # steps that aim at the cheapest exact mesh, not just at an exact one
SETTLED = 0.03  # of the motion: what is left to go along exact meshes
SQUEEZED = 0.3  # of the size: quads of a net with a shorter edge are no start for a finer mesh
CLEAR = 0.08  # |κ₁ − κ₂| over |κ₁| + |κ₂|: beside an umbilic, where lines of curvature turn
DAMPING = 1e-11  # over the mean diagonal


@dataclass(frozen=True, eq=False)
class QuadMesh:
    """An exact quad mesh, and how exact.

    Attributes
    ----------
    mesh : PolyMesh
    kind : str
        "planar", "circular" or "conical".
    planarity : float
        Largest distance of a corner from its face's plane, over the mean edge.
    exactness : float
        The largest of it and, by kind, ``circularity`` of faces, or ``conicality`` of vertices and
        what sums of opposite angles about them differ by, in radians.
    moved : (V,) float
        How far vertices moved, mm.
    steps : int
    levels : tuple of float
        ``planarity`` before optimisation, coarse to fine.
    """

    mesh: PolyMesh
    kind: str
    planarity: float
    exactness: float
    moved: FloatArray
    steps: int
    levels: tuple[float, ...]


def exact_quads(
    mesh: PolyMesh,
    kind: str = "planar",
    *,
    reference: Reference | PolyMesh | None = None,
    closeness: float = 1.0,
    keep_border: bool = False,
    most_steps: int = 60,
) -> QuadMesh:
    """Return the nearest quad mesh that is planar, circular or conical, by Gauss–Newton.

    Parameters
    ----------
    mesh : PolyMesh
        Quadrilaterals; for circular and conical meshes nearly along principal curves, with inner
        vertices of four faces.
    kind : "planar", "circular" or "conical"
    reference : Reference or PolyMesh, optional
        What it is to stay close to.
    closeness : float
        What a square distance from the reference costs, over a square motion along it.
    keep_border : bool
        Border vertices glide along the border curve.
    most_steps : int

    Raises
    ------
    MeshError
        If a face is no quadrilateral, or a vertex of a conical mesh has more than four faces.
    SolveError
        If it stays further than 1e-10 from exact, or a face is not simple; the message names the
        worst face or vertex.

    References
    ----------
    Thesis §3.2, §4.4; Liu, Pottmann, Wallner, Yang, Wang 2006.
    """
    rows = QuadRows(mesh, kind)
    size, start = mean_edge(mesh), np.asarray(mesh.vertices, float)
    middle = start.mean(axis=0)
    near = None if reference is None else as_reference(reference)
    curve = BorderCurve(mesh) if keep_border else None
    hold = Hold(start, np.zeros(len(start), bool), curve, near, closeness)
    before = float(planarity(mesh).max()) / size
    x, best, least, steps, stalled, pulled = start, start, np.inf, 0, 0, True
    while steps < most_steps and stalled < 3:
        step, aside = _step(rows, hold, x, pulled)
        x, steps = x + step, steps + 1
        if not np.abs(x - middle).max() < 10 * np.abs(start - middle).max():
            break
        # The way along exact meshes to the cheapest converges slowly: near it is enough.
        if pulled:
            pulled = steps < PULLS and aside > SETTLED * float(np.linalg.norm(x - start))
            continue
        off = _off(rows, replace(mesh, vertices=x))[0]
        stalled = 0 if off < 0.9 * least and off > 1e-13 else stalled + 1
        if off < least:
            best, least = x, off
    made = replace(mesh, vertices=best)
    off, what = _off(rows, made)
    flat = float(planarity(made).max()) / size
    if not off <= EXACT:
        raise SolveError(
            f"the quads stay {off:.1e} from {kind}, worst at {what}; begin with a mesh nearer to "
            "principal curves, or with smaller faces"
        )
    bad = np.flatnonzero(~simple_faces(made))
    if len(bad):
        place = made.polygon(int(bad[0])).mean(axis=0).round(3).tolist()
        raise SolveError(
            f"{len(bad)} {kind} quads cross themselves, first face {bad[0]} at {place}; begin with "
            "a mesh nearer to principal curves, or with smaller faces"
        )
    moved = np.linalg.norm(best - start, axis=1)
    return QuadMesh(made, kind, flat, off, moved, steps, (before,))


def refined_quads(
    mesh: PolyMesh,
    surface: FreeformSurface | None = None,
    kind: str = "planar",
    *,
    levels: int = 2,
    closeness: float = 1.0,
) -> QuadMesh:
    """Optimise and subdivide a quad mesh in turns.

    Parameters
    ----------
    mesh : PolyMesh
        Coarse.
    surface : FreeformSurface, optional
        Onto which vertices are drawn after each subdivision, and to which they stay close.
    kind : "planar", "circular" or "conical"
    levels : int
        How often to subdivide; each time there are four times as many faces.
    closeness : float
        See ``exact_quads``.

    Raises
    ------
    MeshError, SolveError
        As ``exact_quads``; also if ``levels`` is negative.

    References
    ----------
    Thesis §3.2; Liu, Pottmann, Wallner, Yang, Wang 2006, sec. 3 and 4: the alternation of
    subdivision and optimisation; Catmull and Clark 1978.
    """
    if levels < 0:
        raise MeshError(f"levels = {levels}; 0 or more")
    near = None if surface is None else FreeformReference(surface)
    made = exact_quads(mesh, kind, reference=near, closeness=closeness)
    before, steps = made.levels, made.steps
    for _ in range(levels):
        finer = subdivided(made.mesh)
        if surface is not None:
            foot = surface.point(surface.nearest(finer.vertices))
            finer = replace(finer, vertices=foot)
        made = exact_quads(finer, kind, reference=near, closeness=closeness)
        before, steps = (*before, *made.levels), steps + made.steps
    return replace(made, levels=before, steps=steps)


def principal_quads(
    surface: FreeformSurface,
    size: float,
    kind: str = "planar",
    *,
    family: Family | None = None,
    seed: ArrayLike | None = None,
    levels: int = 2,
    closeness: float = 1.0,
    least_angle: float = 20.0,
) -> QuadMesh:
    """Return a planar, circular or conical quad mesh of a surface.

    Circular and conical meshes leave out what is beside umbilics, and quads squeezed there.

    Parameters
    ----------
    surface : FreeformSurface
    size : float
        About the length of edges in the end, mm.
    kind : "planar", "circular" or "conical"
    family : Family, optional
        Another family than the lines of the greater curvature, as on a sphere, where every
        orthogonal net is one of principal curves; for planar meshes any.
    seed, least_angle
        See ``base_curves``.
    levels : int
        How many of the halvings to ``size`` are done by subdivision; less where the coarse mesh
        would have fewer than three faces a side.
    closeness : float
        See ``exact_quads``.

    Raises
    ------
    LatticeError, SolveError
        If the net has no directions or no quad; if the mesh does not become exact, or has crossing
        faces. The message names the place.
    """
    if levels < 0:
        raise LatticeError(f"levels = {levels}; 0 or more")
    chosen = family or principal_family()
    base = base_curves(surface, chosen, size, seed=seed, least_angle=least_angle)
    shortest = min(high - low for low, high in (base.reach(0), base.reach(1)))
    while levels and shortest < 3 * size * 2**levels:
        levels -= 1
    share = 2**levels
    net = conjugate_net(
        base, even(base, size, 1, multiple=share), even(base, size, 0, multiple=share)
    )
    net = net.every(share)
    if kind == "planar" or not chosen.principal:
        return refined_quads(net.quads(), surface, kind, levels=levels, closeness=closeness)
    # Circular and conical quads follow lines of curvature, which crowd and turn about umbilics.
    mesh = net.quads(shortest=SQUEEZED * size * share, clear=CLEAR)
    try:
        return refined_quads(mesh, surface, kind, levels=levels, closeness=closeness)
    except SolveError as error:
        at = np.unravel_index(int(np.nanargmin(net.umbilicity())), net.there.shape)
        raise SolveError(
            f"{surface.name}: {error}; of the net the point nearest to an umbilic is "
            f"{net.points[at].round(3).tolist()}: seed the net farther from it"
        ) from error


def _step(rows: QuadRows, hold: Hold, x: FloatArray, pulled: bool) -> tuple[FloatArray, float]:
    """The cheapest motion that meets all equations to first order; how much of it is pull."""
    jacobian, residual = rows.linearise(x)
    inverse, anchor = hold.around(x)
    blocks = sp.bsr_array(
        (inverse, np.arange(len(x)), np.arange(len(x) + 1)), shape=(x.size, x.size)
    ).tocsr()
    moved = (blocks @ jacobian.T).tocsr()
    matrix = (jacobian @ moved).tocsc()
    # Equations may depend on each other (a closed mesh): a trace of damping.
    shift = DAMPING * matrix.diagonal().mean()
    factor = factorise(matrix + sp.eye_array(matrix.shape[0], format="csc") * shift)
    straight = -(moved @ factor.solve(residual))
    if not pulled:
        return straight.reshape(-1, 3), 0.0
    pull = (anchor - x).ravel()
    aside = pull - moved @ factor.solve(jacobian @ pull)
    return (straight + aside).reshape(-1, 3), float(np.linalg.norm(aside))


def _off(rows: QuadRows, mesh: PolyMesh) -> tuple[float, str]:
    """Return how far a mesh is from its kind, and where."""
    flat = planarity(mesh) / mean_edge(mesh)
    at = int(np.argmax(flat))
    off, what = float(flat[at]), f"face {at}, {mesh.polygon(at).mean(axis=0).round(3).tolist()}"
    if rows.kind == "circular":
        round_ = circularity(mesh)
        at = int(np.argmax(round_))
        if round_[at] > off:
            place = mesh.polygon(at).mean(axis=0).round(3).tolist()
            off, what = float(round_[at]), f"face {at}, {place}"
    if rows.kind == "conical" and len(rows.vertices):
        cone = np.maximum(conicality(mesh)[rows.vertices], rows.opposite_angles(mesh.vertices))
        at = int(rows.vertices[np.argmax(cone)])
        if cone.max() > off:
            off, what = float(cone.max()), f"vertex {at}, {mesh.vertices[at].round(3).tolist()}"
    return off, what
