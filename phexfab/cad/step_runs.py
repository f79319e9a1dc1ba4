"""The entities of a STEP file as runs: products, their instances, and the faces of their solids.

A run spells out one part of a given topology once; ``phexfab.cad.step`` fills it with numbers.
Corners, edges and edge directions are shared wherever they meet, so that a reader finds closed
solids without sewing.

References
----------
ISO 10303-42 (geometry, topology), -44 (product structure), -46 (colours, layers), -214 and -242
(schemas).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from phexfab.cad.faceted import TOLERANCE, Topology
from phexfab.cad.part21 import Real, Ref, Run


@dataclass(frozen=True)
class Schema:
    """An application protocol: what the header and the application context say."""

    header: str
    context: str
    protocol: str
    year: int


SCHEMAS = {
    "AP214": Schema(
        "AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }",
        "core data for automotive mechanical design processes",
        "automotive_design",
        2000,
    ),
    "AP242": Schema(
        "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }",
        "managed model based 3d engineering",
        "ap242_managed_model_based_3d_engineering",
        2014,
    ),
}

# Entities that every file begins with. Their numbers are used by name below.
_CONTEXT = 1
_AP_CONTEXT, _PRODUCT_CONTEXT, _DESIGN_CONTEXT, _ORIGIN, _Z, _X = 6, 7, 8, 9, 10, 11


def preamble(schema: Schema) -> str:
    """Return the entities that every file begins with: units, contexts, axes."""
    return f"""\
#1=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#5))\
GLOBAL_UNIT_ASSIGNED_CONTEXT((#2,#3,#4))REPRESENTATION_CONTEXT('','3D'));
#2=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));
#3=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));
#4=(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT());
#5=UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({TOLERANCE:.1E}),#2,\
'distance_accuracy_value','largest distance of an edge from its faces');
#6=APPLICATION_CONTEXT('{schema.context}');
#7=PRODUCT_CONTEXT('',#6,'mechanical');
#8=PRODUCT_DEFINITION_CONTEXT('part definition',#6,'design');
#9=CARTESIAN_POINT('',(0.,0.,0.));
#10=DIRECTION('',(0.,0.,1.));
#11=DIRECTION('',(1.,0.,0.));
#12=APPLICATION_PROTOCOL_DEFINITION('international standard','{schema.protocol}',{schema.year},#6);
"""


FREE = 13

# Offsets from a product's first entity, in the order of _add_product.
_PRODUCT, _DEFINITION, _SHAPE, _PLACEMENT = 0, 2, 3, 4

# Offsets back from the end of a part's run, in the order of _finish_part.
STYLED, SOLID = -1, -9


def _add_product(run: Run) -> None:
    """Append the entities of a product; their offsets are the constants above."""
    product = run.add(f"PRODUCT(%s,%s,'',(#{_PRODUCT_CONTEXT}))", None, None)
    formation = run.add("PRODUCT_DEFINITION_FORMATION('','',%s)", product)
    definition = run.add(f"PRODUCT_DEFINITION('design','',%s,#{_DESIGN_CONTEXT})", formation)
    run.add("PRODUCT_DEFINITION_SHAPE('','',%s)", definition)
    run.add(f"AXIS2_PLACEMENT_3D('',#{_ORIGIN},#{_Z},#{_X})")


def _add_instance(run: Run, representation: Ref, parent: int) -> None:
    """Append the occurrence of the run's product in the assembly that begins at ``parent``."""
    usage = run.add(
        f"NEXT_ASSEMBLY_USAGE_OCCURRENCE(%s,%s,'',#{parent + _DEFINITION},%s,$)",
        None,
        None,
        Ref(_DEFINITION),
    )
    shape = run.add("PRODUCT_DEFINITION_SHAPE('placement','an instance of a part',%s)", usage)
    transform = run.add(
        f"ITEM_DEFINED_TRANSFORMATION('','',%s,#{parent + _PLACEMENT})", Ref(_PLACEMENT)
    )
    relation = run.add(
        f"(REPRESENTATION_RELATIONSHIP('','',%s,#{parent + _PLACEMENT + 1})"
        "REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(%s)"
        "SHAPE_REPRESENTATION_RELATIONSHIP())",
        representation,
        transform,
    )
    run.add("CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(%s,%s)", relation, shape)


def assembly(parent: int | None) -> Run:
    """Return the run of an assembly: a product whose shape is only a placement."""
    run = Run()
    _add_product(run)
    shape = run.add(f"SHAPE_REPRESENTATION(%s,(%s),#{_CONTEXT})", None, Ref(_PLACEMENT))
    run.add("SHAPE_DEFINITION_REPRESENTATION(%s,%s)", Ref(_SHAPE), shape)
    if parent is not None:
        _add_instance(run, shape, parent)
    return run


def _finish_part(run: Run, faces: Sequence[Ref], parent: int, style: int) -> None:
    """Append shell, solid, representation, instance and colour to the faces of a part."""
    shell = run.add(f"CLOSED_SHELL('',({','.join(['%s'] * len(faces))}))", *faces)
    solid = run.add("MANIFOLD_SOLID_BREP(%s,%s)", None, shell)
    shape = run.add(
        f"ADVANCED_BREP_SHAPE_REPRESENTATION(%s,(%s,%s),#{_CONTEXT})", None, Ref(_PLACEMENT), solid
    )
    run.add("SHAPE_DEFINITION_REPRESENTATION(%s,%s)", Ref(_SHAPE), shape)
    _add_instance(run, shape, parent)
    run.add(f"STYLED_ITEM('',(#{style}),%s)", solid)


def _add_loop(run: Run, sides: Sequence[tuple[Ref, bool]], bound: str) -> Ref:
    oriented = [
        run.add(f"ORIENTED_EDGE('',*,*,%s,.{'T' if forward else 'F'}.)", edge)
        for edge, forward in sides
    ]
    loop = run.add(f"EDGE_LOOP('',({','.join(['%s'] * len(oriented))}))", *oriented)
    return run.add(f"{bound}('',%s,.T.)", loop)


def polyhedron(shape: Topology, parent: int, style: int) -> Run:
    """Return the run of a polyhedral part; columns: used points, edge directions, normals."""
    run = Run()
    _add_product(run)
    points = {v: run.point("CARTESIAN_POINT", 3 * k) for k, v in enumerate(shape.used)}
    vertices = {v: run.add("VERTEX_POINT('',%s)", p) for v, p in points.items()}
    column = 3 * len(points)
    edges, directions = [], []
    for i, j in shape.edges.tolist():
        directions.append(run.point("DIRECTION", column))
        column += 3
        vector = run.add("VECTOR('',%s,1.)", directions[-1])
        line = run.add("LINE('',%s,%s)", points[i], vector)
        edges.append(run.add("EDGE_CURVE('',%s,%s,%s,.T.)", vertices[i], vertices[j], line))
    faces = []
    for corners, loop in zip(shape.faces, shape.loops, strict=True):
        bound = _add_loop(run, [(edges[e], forward) for e, forward in loop], "FACE_OUTER_BOUND")
        normal = run.point("DIRECTION", column)
        column += 3
        # A corner and a side of the face serve as the plane's origin and x-axis.
        place = run.add(
            "AXIS2_PLACEMENT_3D('',%s,%s,%s)", points[corners[0]], normal, directions[loop[0][0]]
        )
        plane = run.add("PLANE('',%s)", place)
        faces.append(run.add("ADVANCED_FACE('',(%s),%s,.T.)", bound, plane))
    _finish_part(run, faces, parent, style)
    return run


def cylinder(parent: int, style: int) -> Run:
    """Return the run of a cylinder; columns: base, axis, x-axis, −axis, two seam points, top, r."""
    run = Run()
    _add_product(run)
    base = run.point("CARTESIAN_POINT", 0)
    axis, side, down = (run.point("DIRECTION", column) for column in (3, 6, 9))
    seam_points = [run.point("CARTESIAN_POINT", column) for column in (12, 15)]
    lower, upper = (run.add("VERTEX_POINT('',%s)", p) for p in seam_points)
    top = run.point("CARTESIAN_POINT", 18)
    at_base = run.add("AXIS2_PLACEMENT_3D('',%s,%s,%s)", base, axis, side)
    at_top = run.add("AXIS2_PLACEMENT_3D('',%s,%s,%s)", top, axis, side)
    rims = []
    for place, vertex in ((at_base, lower), (at_top, upper)):
        circle = run.add("CIRCLE('',%s,%s)", place, Real(21))
        rims.append(run.add("EDGE_CURVE('',%s,%s,%s,.T.)", vertex, vertex, circle))
    vector = run.add("VECTOR('',%s,1.)", axis)
    line = run.add("LINE('',%s,%s)", seam_points[0], vector)
    seam = run.add("EDGE_CURVE('',%s,%s,%s,.T.)", lower, upper, line)
    surface = run.add("CYLINDRICAL_SURFACE('',%s,%s)", at_base, Real(21))
    wall_bound = _add_loop(
        run, [(rims[0], True), (seam, True), (rims[1], False), (seam, False)], "FACE_BOUND"
    )
    faces = [run.add("ADVANCED_FACE('',(%s),%s,.T.)", wall_bound, surface)]
    at_foot = run.add("AXIS2_PLACEMENT_3D('',%s,%s,%s)", base, down, side)
    for place, rim, forward in ((at_foot, rims[0], False), (at_top, rims[1], True)):
        bound = _add_loop(run, [(rim, forward)], "FACE_OUTER_BOUND")
        plane = run.add("PLANE('',%s)", place)
        faces.append(run.add("ADVANCED_FACE('',(%s),%s,.T.)", bound, plane))
    _finish_part(run, faces, parent, style)
    return run
