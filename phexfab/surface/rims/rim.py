"""A rim: one closed boundary curve in space, smooth or with sharp corners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import DesignError
from phexfab.surface.rims.corners import rounded_pieces
from phexfab.surface.rims.pieces import Function, Piece, function_piece, length_between, panels_of
from phexfab.surface.rims.spline import clean_points, closed_spline, pieces_between_corners, place

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Rim:
    """A closed curve t ∈ [0, 1) → space (mm), periodic with period 1, made of smooth pieces.

    Build one with `Rim.through`, `Rim.of`, `Rim.joined`, or read it from a file with
    `phexfab.surface.rims.table.read_rim_csv` or `phexfab.cad.rims.read_rims`.

    Attributes
    ----------
    name
        What messages call it.
    corners
        (c,) parameters of the sharp corners, ascending in [0, 1); empty: a smooth closed curve.
    pieces
        The smooth pieces in their order.
    breaks
        (p + 1,) parameters from 0 to 1 at which the pieces meet; every corner is one of them.

    Examples
    --------
    >>> import phexfab as px
    >>> posts = [(0, 0, 2600), (5000, 0, 3400), (5000, 4000, 2600), (0, 4000, 3400)]  # mm
    >>> rim = px.Rim.through(posts, corners=[0, 1, 2, 3])
    >>> print(f"{rim.length:.0f} mm, {len(rim.sides())} straight sides")
    18286 mm, 4 straight sides
    >>> print(rim.point(rim.corners[1]).round(6))
    [5000.    0. 3400.]
    """

    name: str
    corners: FloatArray
    pieces: tuple[Piece, ...]
    breaks: FloatArray

    @classmethod
    def through(cls, points: ArrayLike, corners: Sequence[int] = (), name: str = "rim") -> Rim:
        """Return the closed curve that interpolates points.

        Without corners a periodic spline of degree 5, with corners a spline of degree 5 for each
        side; two points, or points on a line, give an exactly straight side. The spline's
        parameter is its own arc length, found by iteration, so that the error falls with the
        sixth power of the spacing on smooth data however uneven the spacing.

        Parameters
        ----------
        points
            (n, 3) in mm, in order, n >= 3; the last is joined to the first (a last point equal
            to the first is left out).
        corners
            Indices of the points that are sharp corners. With corners, t = 0 is the first.
        name
            What messages call it.

        Raises
        ------
        DesignError
            Fewer than 3 points, a number that is not finite, duplicate points, or an interpolant
            that overshoots because the spacing is too uneven; the place is named.

        References
        ----------
        M. S. Floater, T. Surazhsky, "Parameterization for curve interpolation",
        Topics in Multivariate Approximation and Interpolation, 2006, 39-54.
        """
        found, sharp = clean_points(points, corners, name)
        if not len(sharp):
            pieces = [closed_spline(found, name)]
        else:
            pieces = pieces_between_corners(found, sharp, name)
        return cls.joined(pieces, sharp=range(len(sharp)), name=name)

    @classmethod
    def of(
        cls,
        function: Function,
        derivative: Function | Sequence[Function],
        corners: Sequence[float] = (),
        name: str = "rim",
    ) -> Rim:
        """Return the rim of exact callables t (n,) → (n, 3) with period 1.

        Parameters
        ----------
        function
            Points, mm.
        derivative
            The first derivative by t, or a sequence of derivatives of order 1, 2, ...; at a
            corner the value of the side that begins there. Higher orders than given come from
            eighth-order differences.
        corners
            Parameters in [0, 1) of sharp corners.
        name
            What messages call it.
        """
        given = (derivative,) if callable(derivative) else tuple(derivative)
        sharp = np.unique(np.asarray(corners, dtype=float) % 1.0)
        breaks = np.unique(np.concatenate([[0.0, 1.0], sharp]))
        ends = pairwise(breaks.tolist())
        pieces = [function_piece((function, *given), a, b) for a, b in ends]
        return cls(name, sharp, tuple(pieces), breaks)

    @classmethod
    def joined(
        cls,
        pieces: Sequence[Piece],
        sharp: Sequence[int] | range = (),
        name: str = "rim",
        spans: Sequence[float] | None = None,
    ) -> Rim:
        """Return the rim of pieces end to end; ``sharp`` numbers those that begin at a corner.

        The parameter is shared out by ``spans``, arc length by default. That the ends meet is for
        the caller to see to.
        """
        shares = np.array(spans if spans is not None else [piece.length for piece in pieces])
        if not np.all(shares > 0.0):
            at = int(np.argmin(shares))
            where = pieces[at].values(np.zeros(1), 0)[0]
            raise DesignError(
                f"{name}: piece {at + 1} of {len(pieces)} at {place(where)} has no length; "
                "remove it"
            )
        breaks = np.concatenate([[0.0], np.cumsum(shares) / shares.sum()])
        breaks[-1] = 1.0
        chosen = breaks[sorted(set(sharp))] if len(sharp) else np.empty(0)
        return cls(name, chosen, tuple(pieces), breaks)

    def point(self, t: ArrayLike) -> FloatArray:
        """Return points (..., 3), mm, at parameters of any shape."""
        return self._evaluate(t, 0, before=False)

    def derivative(self, t: ArrayLike, order: int = 1, before: bool = False) -> FloatArray:
        """Return derivatives by t (..., 3).

        Where two pieces meet, and so at a corner, the values of the side that begins there; with
        ``before`` those of the side that ends there.
        """
        return self._evaluate(t, order, before)

    def _evaluate(self, t: ArrayLike, order: int, before: bool) -> FloatArray:
        asked = np.asarray(t, dtype=float)
        flat = asked.ravel()
        wrapped = flat - np.floor(flat)
        wrapped[wrapped >= 1.0] = 0.0  # −1e-20 − floor(−1e-20) rounds to 1
        if before:
            wrapped[wrapped == 0.0] = 1.0
        at = np.searchsorted(self.breaks, wrapped, side="left" if before else "right") - 1
        at = np.clip(at, 0, len(self.pieces) - 1)
        out = np.empty((len(flat), 3))
        for k in np.unique(at):
            mine = at == k
            low, width = self.breaks[k], self.breaks[k + 1] - self.breaks[k]
            s = np.clip((wrapped[mine] - low) / width, 0.0, 1.0)
            out[mine] = self.pieces[k].values(s, order) / width**order
        return out.reshape(*asked.shape, 3)

    def sides(self) -> tuple[tuple[float, float], ...]:
        """Return (t0, t1) of each side from corner to corner; the last may run past 1.

        A smooth rim is one side (0, 1).
        """
        if not len(self.corners):
            return ((0.0, 1.0),)
        ends = [*self.corners[1:].tolist(), float(self.corners[0]) + 1.0]
        return tuple(zip(self.corners.tolist(), ends, strict=True))

    def is_straight(self, side: int) -> bool:
        """Return whether a side (by its number in `sides`) is one exactly straight line."""
        t0, _ = self.sides()[side]
        at = int(np.searchsorted(self.breaks, t0, side="right")) - 1
        following = float(self.breaks[at + 1]) % 1.0
        whole = len(self.corners) > 0 and bool(np.any(self.corners == following))
        return whole and self.pieces[at].straight

    @cached_property
    def _lengths(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Panel ends in t (q + 1,), arc length up to each (q + 1,), piece of each panel (q,)."""
        ends, lengths, owner = [], [], []
        for k, piece in enumerate(self.pieces):
            panels = panels_of(piece)
            low, high = self.breaks[k], self.breaks[k + 1]
            ends.append(low + panels[:-1] * (high - low))
            lengths.append(length_between(piece, panels[:-1], panels[1:]))
            owner.append(np.full(len(panels) - 1, k))
        t = np.concatenate([*ends, [1.0]])
        return t, np.concatenate([[0.0], np.cumsum(np.concatenate(lengths))]), np.concatenate(owner)

    @property
    def length(self) -> float:
        """Length of the whole curve, mm."""
        return float(self._lengths[1][-1])

    def arc_length(self, t: ArrayLike) -> FloatArray:
        """Return arc length (...), mm, from t = 0 to each t; beyond [0, 1] it goes on."""
        asked = np.asarray(t, dtype=float)
        flat = asked.ravel()
        turns = np.floor(flat)
        rest = flat - turns
        ends, sums, owner = self._lengths
        at = np.clip(np.searchsorted(ends, rest, side="right") - 1, 0, len(owner) - 1)
        out = turns * self.length + sums[at]
        for k in np.unique(owner[at]):
            mine = owner[at] == k
            low, width = self.breaks[k], self.breaks[k + 1] - self.breaks[k]
            first, last = (ends[at[mine]] - low) / width, (rest[mine] - low) / width
            out[mine] += length_between(self.pieces[k], first, last)
        return out.reshape(asked.shape)

    def at_length(self, length: ArrayLike) -> FloatArray:
        """Return the parameters (...) at arc lengths (mm) from t = 0; inverse of `arc_length`."""
        asked = np.asarray(length, dtype=float)
        turns = np.floor(asked.ravel() / self.length)
        rest = asked.ravel() - turns * self.length
        ends, sums, _ = self._lengths
        at = np.clip(np.searchsorted(sums, rest, side="right") - 1, 0, len(ends) - 2)
        t = np.interp(rest, sums, ends)
        for _ in range(6):
            speed = np.linalg.norm(self.derivative(t), axis=1)
            step = (rest - self.arc_length(t)) / np.maximum(speed, 1e-300)
            t = np.clip(t + step, ends[at], ends[at + 1])
            if np.all(np.abs(step) <= 1e-15):
                break
        return (turns + t).reshape(asked.shape)

    def samples(self, n: int) -> tuple[FloatArray, FloatArray]:
        """Return n parameters (n,) and points (n, 3), uniform in arc length on each side.

        Every corner is among them exactly; each side gets its share of n by length, at least one.

        Raises
        ------
        DesignError
            If n is less than 3 or than the number of corners.
        """
        sides = self.sides()
        if n < max(3, len(sides)):
            raise DesignError(
                f"{self.name}: {n} samples asked for, but it has {len(self.corners)} corners; "
                f"ask for at least {max(3, len(sides))}"
            )
        ends = self.arc_length(np.array([[a, b] for a, b in sides]))
        counts = _share(np.maximum(ends[:, 1] - ends[:, 0], 0.0), n)
        parts = []
        for (t0, _), (low, high), count in zip(sides, ends, counts, strict=True):
            t = self.at_length(low + (high - low) * np.arange(count) / count)
            t[0] = t0
            parts.append(t)
        t = np.concatenate(parts) % 1.0
        return t, self.point(t)

    @cached_property
    def box(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest coordinates (3,), (3,) over a dense sampling, mm."""
        points = self.point(self._dense)
        return points.min(axis=0), points.max(axis=0)

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, mm."""
        low, high = self.box
        return float(np.linalg.norm(high - low))

    @cached_property
    def _dense(self) -> FloatArray:
        ends = self._lengths[0]
        inside = np.linspace(0.0, 1.0, 4, endpoint=False)
        return (ends[:-1, None] + np.diff(ends)[:, None] * inside).ravel()

    def planar(self) -> tuple[float, FloatArray, FloatArray]:
        """Return the greatest distance from the best plane (mm), a point of it and its normal.

        The plane is that of least squares over points uniform in arc length; the normal (3,) is
        the one about which the rim runs counter-clockwise.
        """
        _, points = self.samples(max(512, 4 * len(self.corners)))
        centre = points.mean(axis=0)
        offset = points - centre
        normal = np.linalg.svd(offset, full_matrices=False)[2][2]
        turning = np.cross(offset, np.roll(offset, -1, axis=0)).sum(axis=0)
        if turning @ normal < 0.0:
            normal = -normal
        return float(np.abs(offset @ normal).max()), centre, normal

    def turning(self, t: ArrayLike) -> FloatArray:
        """Return the angles (...) in degrees by which the tangent turns at parameters."""
        after, before = self.derivative(t), self.derivative(t, before=True)
        cross = np.linalg.norm(np.cross(before, after), axis=-1)
        return np.degrees(np.arctan2(cross, np.sum(before * after, axis=-1)))

    def smoothed(self, radius: float, which: Sequence[int] | None = None) -> Rim:
        """Return the rim with corners rounded within an arc length ``radius`` (mm) of each.

        A blend of degree 7 takes position, tangent, curvature and its rate of change from both
        sides, and follows the circular arc between them closely, which bends least. Between
        straight sides that turn by θ it passes the corner at a distance of
        radius · sin(θ/2) · (1 − 11/32 · θ / tan(θ/2)), 0.33 · radius at right angles, and lies
        between the corner and the chord; outside the radius nothing changes.

        Parameters
        ----------
        radius
            At most 0.499 of a side of which both ends are rounded, 0.9 of one with a sharp end.
        which
            Numbers of the corners to round (places in ``corners``); all by default.

        Raises
        ------
        DesignError
            If the radius does not fit; the message names corner, place and greatest radius.
        """
        pieces, sharp, spans = rounded_pieces(self, radius, which)
        return type(self).joined(pieces, sharp, self.name, spans)

    def reversed(self) -> Rim:
        """Return the same curve run through the other way, t ↦ −t."""
        pieces = tuple(piece.reversed() for piece in self.pieces[::-1])
        breaks = 1.0 - self.breaks[::-1]
        place_of = np.searchsorted(self.breaks, self.corners)
        corners = np.sort(breaks[len(self.pieces) - place_of] % 1.0)
        return replace(self, corners=corners, pieces=pieces, breaks=breaks)

    def transformed(self, linear: ArrayLike, shift: ArrayLike = (0.0, 0.0, 0.0)) -> Rim:
        """Return the image under x ↦ linear @ x + shift; linear (3, 3), shift (3,) in mm."""
        a, b = np.asarray(linear, dtype=float), np.asarray(shift, dtype=float)
        return replace(self, pieces=tuple(piece.transformed(a, b) for piece in self.pieces))

    def moved(self, shift: ArrayLike) -> Rim:
        """Return the rim moved by a vector (3,), mm."""
        return self.transformed(np.eye(3), shift)

    def scaled(self, factor: float) -> Rim:
        """Return the rim scaled about the origin, as 1000 does from metres to mm."""
        return self.transformed(factor * np.eye(3))

    def named(self, name: str) -> Rim:
        """Return the same rim under another name."""
        return replace(self, name=name)


def _share(weights: FloatArray, total: int) -> NDArray[np.intp]:
    """Share ``total`` out by weight with at least one each: largest remainders, ties to the first.

    Each gets one and the rest is shared out by what each is still short of.
    """
    wish = total * weights / weights.sum()
    counts = np.maximum(np.floor(wish).astype(np.intp), 1)
    while counts.sum() > total:
        counts[int(np.argmax(np.where(counts > 1, counts - wish, -np.inf)))] -= 1
    short = np.argsort(-(wish - counts), kind="stable")[: total - int(counts.sum())]
    counts[short] += 1
    return counts
