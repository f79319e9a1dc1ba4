"""All checks of a shell and its parts, in one place; see ``docs/checks.md``."""

from phexfab.fabrication.geometry_checks import check_geometry, measure
from phexfab.fabrication.limits import KINDS, CheckKind, Limits
from phexfab.fabrication.part_checks import check_parts

__all__ = ["KINDS", "CheckKind", "Limits", "check_geometry", "check_parts", "measure"]
