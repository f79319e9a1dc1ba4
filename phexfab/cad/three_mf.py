"""3MF for slicers: named bodies in millimetres, with a material each.

References
----------
3MF Consortium, 3MF Core Specification 1.3; ISO/IEC 29500-2 (the package).
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from phexfab.cad.triangles import Body
from phexfab.whole import whole

_MODEL = "3D/3dmodel.model"
_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
_TYPES = f"""<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="{_PACKAGE}/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>
"""
_LINKS = f"""<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="{_PACKAGE}/relationships">
<Relationship Target="/{_MODEL}" Id="rel0" \
Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
</Relationships>
"""
_EARLIEST = (1980, 1, 1, 0, 0, 0)  # what a zip archive can say: the same model, the same bytes


def write_3mf(
    bodies: Sequence[Body],
    path: str | Path,
    metadata: Mapping[str, str],
    material: tuple[str, tuple[float, float, float]],
) -> Path:
    """Write closed bodies, each an object of its own where it stands on the bed.

    Parameters
    ----------
    bodies : sequence of Body
        In mm; x and y from the corner of the bed.
    path : str or Path
    metadata : mapping
        Of the names that the specification knows: ``Title``, ``Designer``, ``Description``,
        ``Application``, ``CreationDate`` …; empty values are left out.
    material : (str, (float, float, float))
        Name and colour (red, green, blue from 0 to 1) of all bodies.
    """
    text = "".join(_model(bodies, metadata, material))
    with whole(path) as draft, zipfile.ZipFile(draft, "w") as archive:
        entries = (("[Content_Types].xml", _TYPES), ("_rels/.rels", _LINKS), (_MODEL, text))
        for name, content in entries:
            entry = zipfile.ZipInfo(name, _EARLIEST)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3  # said the same on every system
            archive.writestr(entry, content, compresslevel=6)
    return Path(path)


def _model(
    bodies: Sequence[Body],
    metadata: Mapping[str, str],
    material: tuple[str, tuple[float, float, float]],
) -> Iterator[str]:
    yield (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<model unit="millimeter" xml:lang="en" xmlns="{_CORE}">\n'
    )
    for key, value in metadata.items():
        if value:
            yield f"<metadata name={quoteattr(key)}>{escape(value)}</metadata>\n"
    name, colour = material
    code = "".join(f"{round(255 * channel):02X}" for channel in colour)
    yield (
        f'<resources>\n<basematerials id="1">'
        f'<base name={quoteattr(name)} displaycolor="#{code}"/></basematerials>\n'
    )
    for number, body in enumerate(bodies, 2):
        label = quoteattr(body.mark)
        yield (
            f'<object id="{number}" type="model" name={label} partnumber={label} pid="1" '
            'pindex="0"><mesh>\n<vertices>\n'
        )
        for x, y, z in body.points.tolist():
            yield f'<vertex x="{x:.10g}" y="{y:.10g}" z="{z:.10g}"/>\n'
        yield "</vertices>\n<triangles>\n"
        for a, b, c in body.triangles.tolist():
            yield f'<triangle v1="{a}" v2="{b}" v3="{c}"/>\n'
        yield "</triangles>\n</mesh></object>\n"
    yield "</resources>\n<build>\n"
    for number in range(2, len(bodies) + 2):
        yield f'<item objectid="{number}"/>\n'
    yield "</build>\n</model>\n"
