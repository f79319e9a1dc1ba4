"""Rims and designs for the claims about films, and what every shell made from them must satisfy."""

import numpy as np

from phexfab.design.load import make_design
from phexfab.fabrication.geometry_checks import bad_faces, node_axis_torsion
from phexfab.forming import form
from phexfab.mesh.measures import mean_edge, planarity
from phexfab.parallel.curvature import minimality
from phexfab.surface.rims.rim import Rim

TURN = 2 * np.pi
KINDS = ("face", "edge", "vertex")


def design(surface=None, panel_size=500.0, kind="face", **tables):
    """A design; ``rim`` stands for rims that are handed over."""
    base = {
        "surface": surface or {"rim": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]},
        "lattice": {"panel_size": panel_size, **tables.pop("lattice", {})},
        "offset": {"type": kind},
        "panels": {"gap": 4.0, "thickness": 4.0},
        "beams": {"kind": "none"},
    }
    return make_design(base | tables)


def waves(up=(), out=(), size=1.0, across=(1.0, 1.0), name="rim"):
    """A rim r(1 + out)(a cos θ, b sin θ), z = r·up: Fourier series given as (n, cosine, sine)."""

    def series(terms, angle, order):
        total = np.zeros_like(angle)
        for n, c, s in terms:
            turned = n * angle + order * np.pi / 2
            total = total + n**order * (c * np.cos(turned) + s * np.sin(turned))
        return total

    def at(order):
        def values(t):
            angle = TURN * np.asarray(t, float)
            r = [series(out, angle, k) + (k == 0) for k in range(order + 1)]
            z = series(up, angle, order)
            flat = []
            for k, axis in enumerate((across[0], across[1])):
                # Leibniz, with the derivatives of cos and sin.
                terms = [
                    _binomial(order, j) * r[j] * np.cos(angle + (order - j - k) * np.pi / 2)
                    for j in range(order + 1)
                ]
                flat.append(axis * sum(terms))
            return TURN**order * size * np.stack([*flat, z], -1)

        return values

    return Rim.of(at(0), [at(1), at(2)], name=name)


def _binomial(n, k):
    return (1, n, n * (n - 1) // 2)[k]


def assert_exact(shell, limit=1e-10):
    """Planar, minimal, simple, parallel to its Gauss image and free of torsion: to rounding.

    So is what it was cut from, but for panels beyond the rim, which may cross themselves.
    """
    assert not bad_faces(shell).any()
    for one in (shell, shell.whole):
        assert (planarity(one.mesh) / mean_edge(one.mesh)).max() <= 1e-12
        assert minimality(one).max() <= limit
        tail, head = one.edges[:, :2].T
        m = one.mesh.vertices[head] - one.mesh.vertices[tail]
        s = one.gauss.vertices[head] - one.gauss.vertices[tail]
        off = np.linalg.norm(np.cross(m, s), axis=1) / np.linalg.norm(m, axis=1)
        assert off.max() <= 1e-10
        assert node_axis_torsion(one).max() <= 1e-6


def lobed(lobes, height=0.18, size=6000.0):
    """A circle that goes up and down so many times; its film has ``lobes`` − 2 umbilics."""
    return waves(up=[(lobes, height, 0.0)], size=size, name=f"{lobes} lobes")


def ring(radius, centre=(0.0, 0.0, 0.0), tilt=0.0):
    """A circle, tilted about y."""
    flat = waves(size=radius)
    c, s = np.cos(tilt), np.sin(tilt)
    turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    return Rim.of(
        lambda t: flat.point(t) @ turn + np.asarray(centre, float),
        lambda t: flat.derivative(t) @ turn,
        name="ring",
    )


def made(rims=(), **asked):
    """The form of a design, with all that its shell promises asserted."""
    found = form(design(**asked), lambda stage, done, total: None, rims)
    assert_exact(found.shell)
    return found


def umbilic_order(shell):
    """The total order of the umbilics with a panel: 3(m + 2) sides for order m."""
    sides = shell.whole.mesh.sides
    assert (sides % 3 == 0).all()
    return int((sides // 3 - 2).sum())


def random_rim(modes, size, across):
    """A rim of waves (n, up, up, out, out) with factors in [−1, 1]; curvature falls with n."""
    up = [(n, 0.5 * a / n**2, 0.5 * b / n**2) for n, a, b, _, _ in modes if n > 1]
    out = [(n, 0.25 * c / n**2, 0.25 * d / n**2) for n, _, _, c, d in modes]
    return waves(up or [(2, 0.15, 0.0)], out, size / 2, (1.0, across))
