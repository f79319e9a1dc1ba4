"""Binary STL: triangles and nothing else, in millimetres by custom."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from phexfab.cad.triangles import Body
from phexfab.whole import whole

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")])
_HEADER = 80


def write_stl(bodies: Sequence[Body], path: str | Path, title: str = "") -> Path:
    """Write closed bodies, which do not overlap, as one binary STL file.

    The format knows neither names nor units; the title goes into the header, which most programs
    pass over.
    """
    corners = np.concatenate([body.points[body.triangles] for body in bodies])
    records = np.zeros(len(corners), _RECORD)
    records["corners"] = corners
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    records["normal"] = np.divide(normals, size, out=np.zeros_like(normals), where=size > 0)
    # A reader takes a file that begins with "solid" for text.
    head = f"phexfab, mm: {title}".encode("ascii", "replace")[:_HEADER].ljust(_HEADER)
    count = len(records).to_bytes(4, "little")
    with whole(path) as draft:
        draft.write_bytes(head + count + records.tobytes())
    return Path(path)
