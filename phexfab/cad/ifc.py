"""IFC4 for building models: plates, members and hubs with marks, materials and quantities.

One assembly, the shell, stands in project, site, building and storey; its families are assemblies
in it. What a parts list says of a part is in the standard property and quantity sets, so that
other programs can count and schedule it. Geometry is exact: faces as they are, hubs as extruded
circles. Identifiers follow from the design's name and the mark: the same design keeps them.

References
----------
ISO 16739-1:2018 (IFC4 ADD2 TC1).
"""

from __future__ import annotations

import math
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from phexfab.cad.step import StepHeader, default_timestamp
from phexfab.cad.tree import Family, Part, families, geometry, material, metadata
from phexfab.errors import MissingLibraryError
from phexfab.fabrication.parts import Beam, Cylinder, Panel, Parts
from phexfab.fabrication.polyhedra import surface_areas
from phexfab.whole import whole

if TYPE_CHECKING:
    import ifcopenshell
    from ifcopenshell import entity_instance as Entity

INSTALL = 'python -m pip install "phexfab[ifc]"'
_SPACE = uuid.UUID("7a1d4b52-6d7e-5b0c-9f3c-2f6a1f0e8c11")  # names of phexfab's own, for uuid5
_DECIMALS = 7  # of coordinates, mm
_CLASSES = {
    "panels": ("IfcPlate", "SHEET"),
    "beams": ("IfcMember", "MEMBER"),
    "nodes": ("IfcDiscreteAccessory", "USERDEFINED"),
}


def write_ifc(parts: Parts, path: str | Path, header: StepHeader | None = None) -> Path:
    """Write panels, beams and nodes as an IFC4 building model.

    Parameters
    ----------
    parts : Parts
    path : str or Path
        Replaced as a whole when the file is complete.
    header : StepHeader, optional
        Name, author, organisation and time.

    Raises
    ------
    PartError
        If marks are not unique or there is no part.
    MissingLibraryError
        If ifcopenshell is not installed; the message says how to install it.
    """
    header = header or StepHeader()
    tree = families(parts)
    model = _Model(header)
    shell = model.shell()
    model.groups(shell, [model.family(family, shell) for family in tree])
    with whole(path) as draft:
        model.file.write(str(draft), format=".ifc")
    return Path(path)


def _library() -> Any:
    try:
        import ifcopenshell
        import ifcopenshell.guid
    except ImportError as error:
        raise MissingLibraryError(
            f"ifcopenshell does not load: {error}. IFC needs it; install it by: {INSTALL}"
        ) from error
    return ifcopenshell


class _Model:
    """An IFC file that grows from the project down to the parts."""

    def __init__(self, header: StepHeader) -> None:
        self.library = _library()
        self.file: ifcopenshell.file = self.library.file(schema="IFC4")
        self.name = header.name
        stamp = default_timestamp() if header.timestamp is None else header.timestamp
        named = self.file.header.file_name
        named.name, named.time_stamp = header.name, stamp
        named.author, named.organization = (header.author,), (header.organisation,)
        named.preprocessor_version = named.originating_system = header.system
        named.authorization = ""
        self.file.header.file_description.description = ("ViewDefinition [ReferenceView_V1.2]",)
        self.axes = self.make(
            "IfcAxis2Placement3D", Location=self.make("IfcCartesianPoint", (0.0, 0.0, 0.0))
        )
        context = self.make(
            "IfcGeometricRepresentationContext",
            ContextType="Model",
            CoordinateSpaceDimension=3,
            Precision=1e-5,
            WorldCoordinateSystem=self.axes,
        )
        self.body = self.make(
            "IfcGeometricRepresentationSubContext",
            ContextIdentifier="Body",
            ContextType="Model",
            ParentContext=context,
            TargetView="MODEL_VIEW",
        )
        self.project = self.rooted(
            "IfcProject",
            "project",
            Name=header.name,
            RepresentationContexts=[context],
            UnitsInContext=self._units(),
        )

    def make(self, kind: str, *values: Any, **attributes: Any) -> Entity:
        """Return a new entity."""
        entity: Entity = self.file.create_entity(kind, *values, **attributes)
        return entity

    def rooted(self, kind: str, key: str, **attributes: Any) -> Entity:
        """Return a new entity whose identifier follows from the design's name and a key."""
        number = uuid.uuid5(_SPACE, f"{self.name}/{key}")
        return self.make(kind, GlobalId=self.library.guid.compress(number.hex), **attributes)

    def _units(self) -> Entity:
        def si(kind: str, name: str, prefix: str | None = None) -> Entity:
            return self.make("IfcSIUnit", UnitType=kind, Prefix=prefix, Name=name)

        length = si("LENGTHUNIT", "METRE", "MILLI")
        mass = si("MASSUNIT", "GRAM", "KILO")
        radian = si("PLANEANGLEUNIT", "RADIAN")
        ratio = self.make(
            "IfcMeasureWithUnit",
            self.make("IfcPlaneAngleMeasure", math.pi / 180),
            radian,
        )
        angle = self.make("IfcDimensionalExponents", 0, 0, 0, 0, 0, 0, 0)
        degree = self.make("IfcConversionBasedUnit", angle, "PLANEANGLEUNIT", "DEGREE", ratio)
        metre = si("LENGTHUNIT", "METRE")
        density = self.make(
            "IfcDerivedUnit",
            Elements=[
                self.make("IfcDerivedUnitElement", mass, 1),
                self.make("IfcDerivedUnitElement", metre, -3),
            ],
            UnitType="MASSDENSITYUNIT",
        )
        area, volume = si("AREAUNIT", "SQUARE_METRE"), si("VOLUMEUNIT", "CUBIC_METRE")
        return self.make("IfcUnitAssignment", [length, area, volume, mass, degree, density])

    def place(self, above: Entity | None, at: Sequence[float] | None = None) -> Entity:
        """Return a placement that moves by ``at`` from the one above it."""
        axes = self.axes
        if at is not None:
            axes = self.make(
                "IfcAxis2Placement3D", Location=self.make("IfcCartesianPoint", tuple(at))
            )
        return self.make("IfcLocalPlacement", PlacementRelTo=above, RelativePlacement=axes)

    def shell(self) -> Entity:
        """Return the assembly of everything, in its storey, building and site."""
        above, placement = self.project, None
        for kind in ("Site", "Building", "BuildingStorey"):
            placement = self.place(placement)
            below = self.rooted(
                f"Ifc{kind}", kind, Name=kind.removeprefix("Building") or kind,
                ObjectPlacement=placement, CompositionType="ELEMENT",
            )  # fmt: skip
            self.groups(above, [below])
            above = below
        shell = self.assembly("shell", self.name, placement)
        self.rooted(
            "IfcRelContainedInSpatialStructure",
            "contained",
            RelatedElements=[shell],
            RelatingStructure=above,
        )
        return shell

    def assembly(self, key: str, name: str, above: Entity | None) -> Entity:
        return self.rooted(
            "IfcElementAssembly",
            f"assembly {key}",
            Name=name,
            ObjectType=key,
            ObjectPlacement=self.place(above),
            PredefinedType="USERDEFINED",
        )

    def groups(self, above: Entity, below: Sequence[Entity]) -> None:
        """Say what a thing consists of."""
        self.rooted(
            "IfcRelAggregates",
            f"parts of {above.GlobalId}",
            RelatingObject=above,
            RelatedObjects=list(below),
        )

    def family(self, family: Family, shell: Entity) -> Entity:
        """Return the assembly of a family with all its parts."""
        whole = self.assembly(family.name, family.name, shell.ObjectPlacement)
        style = self._style(family)
        shapes, elements = [], []
        for part in family.parts:
            shape, element = self.part(family, part, whole.ObjectPlacement)
            self.make("IfcStyledItem", Item=shape, Styles=[style])
            shapes.append(shape)
            elements.append(element)
        self.make("IfcPresentationLayerAssignment", Name=family.name, AssignedItems=shapes)
        self.groups(whole, elements)
        made = material(family.parts[0])
        substance = self.make("IfcMaterial", made.name)
        self.make(
            "IfcMaterialProperties",
            Name="Pset_MaterialCommon",
            Properties=self._values({"MassDensity": ("IfcMassDensityMeasure", made.density)}),
            Material=substance,
        )
        self.rooted(
            "IfcRelAssociatesMaterial",
            f"material of {family.name}",
            RelatedObjects=elements,
            RelatingMaterial=substance,
        )
        kind, predefined = _CLASSES[family.name]
        type_ = self.rooted(
            f"{kind}Type",
            f"type of {family.name}",
            Name=f"{family.name}: {made.name}",
            ElementType="hub" if predefined == "USERDEFINED" else None,
            PredefinedType=predefined,
        )
        self.rooted(
            "IfcRelDefinesByType",
            f"{family.name} by type",
            RelatedObjects=elements,
            RelatingType=type_,
        )
        return whole

    def _style(self, family: Family) -> Entity:
        colour = self.make("IfcColourRgb", None, *family.colour)
        shading = self.make("IfcSurfaceStyleShading", colour, 0.0)
        return self.make("IfcSurfaceStyle", family.name, "BOTH", [shading])

    def part(self, family: Family, part: Part, above: Entity) -> tuple[Entity, Entity]:
        """Return the shape of a part and the part itself, with what is known of it."""
        solid = geometry(part)
        if isinstance(solid, Cylinder):
            kind, placement = "SweptSolid", self._upright(solid, above)
            profile = self.make(
                "IfcCircleProfileDef", ProfileType="AREA", Radius=float(solid.radius)
            )
            shape = self.make(
                "IfcExtrudedAreaSolid",
                SweptArea=profile,
                ExtrudedDirection=self.make("IfcDirection", (0.0, 0.0, 1.0)),
                Depth=float(solid.length),
            )
        else:
            kind, middle = "Tessellation", np.round(solid.vertices.mean(axis=0), _DECIMALS)
            placement = self.place(above, (middle + 0.0).tolist())
            points = np.round(solid.vertices - middle, _DECIMALS) + 0.0
            faces = [
                self.make("IfcIndexedPolygonalFace", [i + 1 for i in face]) for face in solid.faces
            ]
            corners = self.make("IfcCartesianPointList3D", points.tolist())
            shape = self.make("IfcPolygonalFaceSet", corners, True, faces)
        body = self.make("IfcShapeRepresentation", self.body, "Body", kind, [shape])
        ifc_class, predefined = _CLASSES[family.name]
        element = self.rooted(
            ifc_class,
            part.mark,
            Name=part.mark,
            ObjectType="hub" if predefined == "USERDEFINED" else None,
            ObjectPlacement=placement,
            Representation=self.make("IfcProductDefinitionShape", Representations=[body]),
            Tag=part.mark,
            PredefinedType=predefined,
        )
        for name, values in _properties(part).items():
            known = self.rooted(
                "IfcPropertySet", f"{part.mark} {name}", Name=name,
                HasProperties=self._values(values),
            )  # fmt: skip
            self._define(element, name, known)
        name, amounts = _quantities(part)
        known = self.rooted(
            "IfcElementQuantity", f"{part.mark} {name}", Name=name,
            MethodOfMeasurement="BaseQuantities",
            Quantities=[
                self.make(f"IfcQuantity{kind}", Name=word, **{f"{kind}Value": float(amount)})
                for word, (kind, amount) in amounts.items()
            ],
        )  # fmt: skip
        self._define(element, name, known)
        return shape, element

    def _upright(self, cylinder: Cylinder, above: Entity) -> Entity:
        """Return the placement whose z-axis is a cylinder's axis, its origin the base."""
        axis = np.asarray(cylinder.axis, float) / np.linalg.norm(cylinder.axis)
        side = np.cross(np.eye(3)[np.abs(np.round(axis, 6)).argmin()], axis)
        base, axis, side = (
            (np.round(v, 12) + 0.0).tolist()
            for v in (cylinder.base, axis, side / np.linalg.norm(side))
        )
        axes = self.make(
            "IfcAxis2Placement3D",
            self.make("IfcCartesianPoint", base),
            self.make("IfcDirection", axis),
            self.make("IfcDirection", side),
        )
        return self.make("IfcLocalPlacement", PlacementRelTo=above, RelativePlacement=axes)

    def _define(self, element: Entity, name: str, known: Entity) -> None:
        self.rooted(
            "IfcRelDefinesByProperties", f"{element.Name} by {name}",
            RelatedObjects=[element], RelatingPropertyDefinition=known,
        )  # fmt: skip

    def _values(self, values: Mapping[str, tuple[str, Any]]) -> list[Entity]:
        """Return properties from names to a measure and its value; a list becomes list values."""
        made = []
        for name, (measure, value) in values.items():
            if isinstance(value, list):
                rows = [self.make(measure, one) for one in value]
                made.append(self.make("IfcPropertyListValue", Name=name, ListValues=rows))
            else:
                one = self.make(measure, value)
                made.append(self.make("IfcPropertySingleValue", Name=name, NominalValue=one))
        return made


def _properties(part: Part) -> dict[str, dict[str, tuple[str, Any]]]:
    """Return the property sets of a part: the standard one and what only phexfab knows."""
    known = metadata(part)
    standard: dict[str, tuple[str, Any]] = {"Reference": ("IfcIdentifier", part.mark)}
    own: dict[str, tuple[str, Any]] = {"Mark": ("IfcIdentifier", part.mark)}
    neighbours = [mark for mark in known["neighbours"] if mark]
    if neighbours:
        own["Neighbours"] = ("IfcLabel", neighbours)
    if isinstance(part, Panel):
        name = "Pset_PlateCommon"
        standard["LoadBearing"] = ("IfcBoolean", False)
        own["EdgeBevels"] = ("IfcPlaneAngleMeasure", [float(e.bevel) for e in part.flat.edges])
    elif isinstance(part, Beam):
        name = "Pset_MemberCommon"
        standard["Span"] = ("IfcPositiveLengthMeasure", float(part.length))
        standard["LoadBearing"] = ("IfcBoolean", True)
        own["Nodes"] = ("IfcLabel", list(part.nodes))
        own["Mitres"] = ("IfcPlaneAngleMeasure", [float(a) for end in part.mitres for a in end])
        own["Slopes"] = ("IfcPlaneAngleMeasure", [float(a) for a in part.slopes])
    else:
        name = "Pset_ElementComponentCommon"
        own["Radius"] = ("IfcPositiveLengthMeasure", float(part.cylinder.radius))
        own["Length"] = ("IfcPositiveLengthMeasure", float(part.cylinder.length))
    return {name: standard, "Phexfab_Part": own}


def _quantities(part: Part) -> tuple[str, dict[str, tuple[str, float]]]:
    """Return the quantity set of a part: lengths in mm, areas in m², volumes in m³, kg."""
    measured = {
        "NetVolume": ("Volume", part.volume / 1e9),
        "NetWeight": ("Weight", part.mass),
    }
    if isinstance(part, Panel):
        outline = np.asarray(part.flat.outline, float)
        around = np.hypot(*(np.roll(outline, -1, axis=0) - outline).T).sum()
        return "Qto_PlateBaseQuantities", {
            "Width": ("Length", part.flat.thickness),
            "Perimeter": ("Length", float(around)),
            "NetArea": ("Area", part.area / 1e6),
            **measured,
        }
    if isinstance(part, Beam):
        return "Qto_MemberBaseQuantities", {
            "Length": ("Length", part.length),
            "NetSurfaceArea": ("Area", float(surface_areas([part.solid])[0]) / 1e6),
            **measured,
        }
    return "Phexfab_Quantities", measured
