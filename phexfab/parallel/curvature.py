"""Oriented and mixed areas of parallel meshes, and the curvatures that Steiner's formula gives.

Computed from the vertices alone, for any two meshes with the same faces and parallel edges,
whatever the number of sides and the valence. The signs are those of Steiner's formula,

    area(M_f + d·S_f) = (1 − 2 d H_f + d² K_f) · area(M_f),

so a convex shell whose normals point outwards has H < 0; turning the normals of both meshes over
changes nothing, taking −S for S changes the sign of H.

References
----------
Thesis §2.1, §7.1.1; Bobenko, Pottmann, Wallner 2010, "A curvature theory for discrete surfaces
based on mesh parallelity", Math. Ann. 348.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.mesh.measures import face_normals
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.edge_curvature import edge_curvatures
from phexfab.parallel.pairs import require_same_faces
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def pair_mixed_areas(
    mesh: PolyMesh, other: PolyMesh, normals: FloatArray | None = None
) -> FloatArray:
    """Return area(P_f, Q_f), the symmetric bilinear form of the oriented area, of every face.

    Parameters
    ----------
    mesh, other : PolyMesh
        Two parallel meshes; ``other is mesh`` gives the oriented areas.
    normals : (F, 3) unit vectors, optional
        The side from which faces are seen counter-clockwise; the first mesh's own without them.
        Name them where several meshes are compared: a member of P(M) may turn a face over.

    Returns
    -------
    (F,) array, the product of the two units of length.

    Raises
    ------
    MeshError
        If the meshes do not have the same faces.

    References
    ----------
    Thesis §7.1.1.2.
    """
    require_same_faces(mesh, other)
    if not mesh.n_faces:
        return np.zeros(0)
    about = face_normals(mesh) if normals is None else normals
    begin, owner, onward = mesh.starts[:-1], mesh.face_of_corner, mesh.next_corner
    # Areas do not depend on the origin; near the face they suffer least from rounding.
    p, q = mesh.vertices[mesh.corners], other.vertices[mesh.corners]
    p, q = p - p[begin][owner], q - q[begin][owner]
    cross = np.cross(p, q[onward]) + np.cross(q, p[onward])
    parts = np.einsum("ij,ij->i", cross, about[owner])
    return np.add.reduceat(parts, begin) / 4


def principal_curvatures(
    mean: FloatArray, gaussian: FloatArray
) -> tuple[ComplexArray, NDArray[np.bool_]]:
    """Return the roots κ₁, κ₂ of κ² − 2Hκ + K = 0, and where they are real.

    Real wherever K ≤ 0, as on every minimal surface, and, by Minkowski's inequality, for convex
    faces. A face with reflex corners may have H² < K: its roots are then a conjugate pair, whose
    product is still K and whose mean still H, but it bends in no principal direction.

    Parameters
    ----------
    mean, gaussian : (F,) arrays, 1/mm and 1/mm²

    Returns
    -------
    roots : (F, 2) complex
        Real part κ₁ ≥ κ₂; where complex, the root with positive imaginary part first.
    real : (F,) bool

    References
    ----------
    Thesis §7.1.1.2; Bobenko, Pottmann, Wallner 2010, sec. 2.
    """
    h, k = np.asarray(mean, float), np.asarray(gaussian, float)
    square = h * h - k
    real = square >= 0
    root = np.sqrt(square.astype(complex))
    # The root of larger modulus first: the other one follows from the product without cancellation.
    large = h + np.where(h >= 0, root, -root)
    small = np.divide(k, large, out=np.zeros_like(large), where=large != 0)
    first = np.where(h >= 0, large, small)
    second = np.where(h >= 0, small, large)
    return (
        np.column_stack([np.where(real, first, h + root), np.where(real, second, h - root)]),
        real,
    )


@dataclass(frozen=True, eq=False)
class FaceCurvatures:
    """The three areas of every face of a parallel pair (M, S), and all that follows from them.

    Attributes
    ----------
    areas : (F,) area(M_f), mm²
    mixed : (F,) area(M_f, S_f), mm
    gauss_areas : (F,) area(S_f), dimensionless

    A face of M without area has no curvature: its H and K are not numbers.
    """

    areas: FloatArray
    mixed: FloatArray
    gauss_areas: FloatArray

    @property
    def mean(self) -> FloatArray:
        """(F,) H_f = −area(M_f, S_f)/area(M_f), 1/mm."""
        return _divide(-self.mixed, self.areas)

    @property
    def gaussian(self) -> FloatArray:
        """(F,) K_f = area(S_f)/area(M_f), 1/mm²."""
        return _divide(self.gauss_areas, self.areas)

    @property
    def principal(self) -> FloatArray:
        """(F, 2) κ₁ ≥ κ₂, 1/mm; not numbers where the roots are complex (H² < K)."""
        roots, real = principal_curvatures(self.mean, self.gaussian)
        return np.where(real[:, None], roots.real, np.nan)

    @property
    def minimality(self) -> FloatArray:
        """(F,) |H|/√|K| = |area(M_f, S_f)|/√|area(M_f)·area(S_f)|, scale-free.

        0 where all three vanish (a plane), infinite where only the denominator does.
        """
        below = np.sqrt(np.abs(self.areas) * np.abs(self.gauss_areas))
        above = np.abs(self.mixed)
        empty = np.where(above > 0, np.inf, above)  # keeps what is not a number
        return np.divide(above, below, out=empty, where=(below > 0) | np.isnan(below))

    @property
    def total_area(self) -> float:
        """Σ area(M_f), mm²."""
        return float(self.areas.sum())

    @property
    def total_mean(self) -> float:
        """Σ H_f area(M_f), the discrete ∫ H dA, mm."""
        return float(-self.mixed.sum())

    @property
    def total_gaussian(self) -> float:
        """Σ K_f area(M_f) = Σ area(S_f), the discrete ∫ K dA."""
        return float(self.gauss_areas.sum())

    def offset_areas(self, distance: float) -> FloatArray:
        """Return (F,) areas of the faces of M + d·S by Steiner's formula, mm².

        References
        ----------
        Thesis §7.1.1.1–2.
        """
        return self.areas + 2 * distance * self.mixed + distance**2 * self.gauss_areas


def pair_curvatures(
    mesh: PolyMesh, gauss: PolyMesh, normals: FloatArray | None = None
) -> FaceCurvatures:
    """Return areas and curvatures of every face of M with respect to its Gauss image S.

    Parameters
    ----------
    mesh, gauss : PolyMesh
        A parallel pair with the same faces, mm and unit length. That edges are parallel is not
        checked here; see ``phexfab.parallel.pairs.parallelism``.
    normals : (F, 3) unit vectors, optional
        Of M's faces; computed where left out.

    Raises
    ------
    MeshError
        If the meshes do not have the same faces.

    References
    ----------
    Thesis §7.1.1.2.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> found = px.pair_curvatures(shell.mesh, shell.gauss)
    >>> print(f"{found.gaussian.min():.2e} per mm²")
    -1.65e-06 per mm²
    >>> bool(abs(found.mean).max() < 1e-15)  # 1/mm
    True
    """
    about = face_normals(mesh) if normals is None else normals
    return FaceCurvatures(
        pair_mixed_areas(mesh, mesh, about),
        pair_mixed_areas(mesh, gauss, about),
        pair_mixed_areas(gauss, gauss, about),
    )


def shell_curvatures(shell: Shell) -> FaceCurvatures:
    """Return areas and curvatures of every panel of a shell.

    A cut panel keeps H and K from before the cut: a rim plane is no neighbour that it bends to.
    """
    found = pair_curvatures(shell.mesh, shell.gauss, shell.normals[shell.panels])
    if shell.whole is None:
        return found
    before = shell_curvatures(shell.whole)
    parent = np.searchsorted(shell.whole.panels, shell.parents[shell.panels])
    left = found.areas / before.areas[parent]
    return FaceCurvatures(
        found.areas, left * before.mixed[parent], left * before.gauss_areas[parent]
    )


def mixed_areas(shell: Shell, first: FloatArray, second: FloatArray) -> FloatArray:
    """Return area(P_f, Q_f) of every panel for two members of P(M), given by their vertices.

    Parameters
    ----------
    shell : Shell
        Gives the corners and the normals.
    first, second : (V, 3) vertices of two meshes parallel to ``shell.mesh``

    Returns
    -------
    (P,) array; ``first is second`` gives the oriented areas.
    """
    corners, starts = shell.mesh.corners, shell.mesh.starts
    return pair_mixed_areas(
        PolyMesh(first, corners, starts),
        PolyMesh(second, corners, starts),
        shell.normals[shell.panels],
    )


def mean_curvatures(shell: Shell) -> FloatArray:
    """Return H_f = −area(M_f, S_f)/area(M_f) of every panel, 1/mm."""
    return shell_curvatures(shell).mean


def gaussian_curvatures(shell: Shell) -> FloatArray:
    """Return K_f = area(S_f)/area(M_f) of every panel, 1/mm²."""
    return shell_curvatures(shell).gaussian


def minimality(shell: Shell) -> FloatArray:
    """Return the scale-free |H_f|/√|K_f| of every panel; 0 on a discrete minimal surface."""
    return shell_curvatures(shell).minimality


def face_fields(shell: Shell) -> dict[str, tuple[FloatArray, str]]:
    """Return what the panels of a shell may be coloured by: name to ((P,) values, unit).

    Gaussian, mean and both principal curvatures (in 1/m and 1/m²; not numbers where complex),
    the largest modulus among a panel's edge curvatures, its share of the total curvature
    ∫ K dA in steradians, and the scale-free |H|/√|K|.
    """
    mesh = shell.mesh
    if not mesh.n_faces:
        return {}
    found = shell_curvatures(shell)
    principal = found.principal * 1e3
    edge = np.abs(edge_curvatures(mesh, shell.gauss)) * 1e3
    if len(shell.parents):
        edge[shell.parents[shell.rings[3]] < 0] = 0.0
    return {
        "Gaussian curvature": (found.gaussian * 1e6, "1/m²"),
        "Mean curvature": (found.mean * 1e3, "1/m"),
        "First principal curvature": (principal[:, 0], "1/m"),
        "Second principal curvature": (principal[:, 1], "1/m"),
        "Largest edge curvature": (np.maximum.reduceat(edge, mesh.starts[:-1]), "1/m"),
        "Total curvature": (found.gauss_areas, "sr"),
        "|H|/√|K|": (found.minimality, "1"),
    }


def _divide(above: FloatArray, below: FloatArray) -> FloatArray:
    return np.divide(above, below, out=np.full(len(below), np.nan), where=below != 0)
