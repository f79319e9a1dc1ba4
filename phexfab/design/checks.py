"""The limits that a design file can set, one key to a check."""

from __future__ import annotations

from pydantic import Field

from phexfab.design.fields import Degrees, Distance, Mass, Ratio, Section


class Checks(Section):
    """Limits that the finished design is held against; a failed check does not stop the build.

    A key that is left out (None) keeps the limit of ``phexfab.fabrication.limits.Limits``, which
    has a field of the same name for every key here.
    """

    planarity: Ratio | None = Field(
        default=None,
        description="corners off their face's plane / mean edge, at most",
        examples=["1e-12"],
    )
    planarity_mm: Distance | None = Field(
        default=None, description="corners off their face's plane, at most", examples=["1e-6"]
    )
    parallelism: Ratio | None = Field(
        default=None,
        description="sine between an edge and its Gauss image's, at most; 1e-9 with `mesh.method`",
        examples=["1e-10"],
    )
    minimality: Ratio | None = Field(
        default=None, description="mean curvature |H|/√|K|, at most", examples=["1e-10"]
    )
    offset_constancy: Ratio | None = Field(
        default=None, description="Gauss image off the unit sphere, at most", examples=["1e-11"]
    )
    offset_spread: Ratio | None = Field(
        default=None,
        description="distance to the offset off constant, relative, at most",
        examples=["1e-9"],
    )
    offset_interval: Ratio | None = Field(
        default=None,
        description="offset / offset at which an edge vanishes, at most",
        examples=["0.9"],
    )
    node_axis_torsion: Degrees | None = Field(
        default=None, description="node axis off a beam's mid-plane, at most", examples=["1e-6"]
    )
    simple_faces: Ratio | None = Field(
        default=None, description="number of faces that cross themselves, at most", examples=["0"]
    )
    shortest_edge: Distance | None = Field(
        default=None, description="shortest edge, at least", examples=["20"]
    )
    beam_angle: Degrees | None = Field(
        default=None, description="angle between two beams of a node, at least", examples=["30"]
    )
    surface_distance: Distance | None = Field(
        default=None, description="vertices off the smooth surface, at most", examples=["25"]
    )
    rim_distance: Distance | None = Field(
        default=None, description="border off the given rim, at most", examples=["10"]
    )
    sharpest_corner: Degrees | None = Field(
        default=None, description="sharpest corner of a panel, at least", examples=["30"]
    )
    mitre_angle: Degrees | None = Field(
        default=None,
        description="cut of a beam's end against a square one, at most",
        examples=["75"],
    )
    rim_corner: Degrees | None = Field(
        default=None, description="sharpest corner that a rim cuts, at least", examples=["10"]
    )
    rim_beam_angle: Degrees | None = Field(
        default=None, description="angle between two beams at a rim, at least", examples=["10"]
    )
    rim_mitre: Degrees | None = Field(
        default=None,
        description="cut of a beam's end at a rim against a square one, at most",
        examples=["85"],
    )
    panel_fits_sheet: Distance | None = Field(
        default=None, description="panel beyond the usable stock sheet, at most", examples=["0"]
    )
    beam_fits_sheet: Distance | None = Field(
        default=None, description="beam beyond the usable stock sheet, at most", examples=["0"]
    )
    panel_mass: Mass | None = Field(
        default=None, description="heaviest panel, at most", examples=["60"]
    )
    panel_clearance: Distance | None = Field(
        default=None, description="distance between neighbouring panels, at least", examples=["1"]
    )
    interpenetration: Ratio | None = Field(
        default=None,
        description="overlap of two parts / the smaller one, at most",
        examples=["1e-6"],
    )

    def limits(self) -> dict[str, float]:
        """Return the limits that the design sets, by name of the check."""
        return {name: limit for name, limit in self.model_dump().items() if limit is not None}
