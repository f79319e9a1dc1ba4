"""The catalog of minimal surfaces by name, as a design file asks for them."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any

from phexfab.errors import SurfaceError
from phexfab.surface import classical
from phexfab.surface.construct import associate
from phexfab.surface.weierstrass import MinimalSurface


@dataclass(frozen=True)
class CatalogEntry:
    """A surface of the catalog.

    Attributes
    ----------
    name : str
    make : callable
        Returns the surface; its keyword arguments are the options.
    description : str
        One line.
    source : str
        Where it is from.
    """

    name: str
    make: Callable[..., MinimalSurface]
    description: str
    source: str

    @property
    def options(self) -> dict[str, Any]:
        """The options of this surface and their defaults; ``bonnet_angle`` is everyone's."""
        own = {p.name: p.default for p in inspect.signature(self.make).parameters.values()}
        return own if "bonnet_angle" in own else own | {"bonnet_angle": 0.0}


_ENTRIES = (
    CatalogEntry(
        "enneper",
        classical.enneper,
        "Enneper's surface of any order, saddle-shaped; order > 1 beside its umbilic",
        "Enneper, Z. Math. Phys. 9 (1864)",
    ),
    CatalogEntry(
        "catenoid",
        classical.catenoid,
        "the catenoid, a ring that closes: the film between two circles",
        "Euler, Methodus inveniendi (1744)",
    ),
    CatalogEntry(
        "helicoid",
        classical.helicoid,
        "the helicoid, a spiral ramp, conjugate to the catenoid",
        "Meusnier, Mém. Acad. Sci. Paris (1785)",
    ),
    CatalogEntry(
        "catenoid-helicoid",
        classical.catenoid_helicoid,
        "the bending of the catenoid (bonnet_angle = 0) into the helicoid (90)",
        "Bonnet, J. École Polytechnique 42 (1867)",
    ),
    CatalogEntry(
        "scherk-1",
        classical.scherk_1,
        "Scherk's first surface, doubly periodic: a saddle over a square",
        "Scherk, J. reine angew. Math. 13 (1835)",
    ),
    CatalogEntry(
        "scherk-2",
        classical.scherk_2,
        "Scherk's second surface, the singly periodic tower",
        "Scherk, J. reine angew. Math. 13 (1835)",
    ),
    CatalogEntry(
        "henneberg",
        classical.henneberg,
        "Henneberg's one-sided surface, between two of its branch points",
        "Henneberg, Ann. Mat. Pura Appl. 9 (1878)",
    ),
    CatalogEntry(
        "catalan",
        classical.catalan,
        "Catalan's surface, spanned along the arch of a cycloid",
        "Catalan, J. École Polytechnique 37 (1858)",
    ),
    CatalogEntry(
        "bour",
        classical.bour,
        "Bour's surface of any order, applicable to a surface of revolution",
        "Bour, J. École Polytechnique 39 (1862)",
    ),
    CatalogEntry(
        "richmond",
        classical.richmond,
        "Richmond's surface, one planar end and one like Enneper's",
        "Richmond, Trans. Cambridge Phil. Soc. 18 (1900)",
    ),
    CatalogEntry(
        "trinoid",
        classical.trinoid,
        "the trinoid, three catenoidal ends; the saddle between two of them",
        "Jorge, Meeks, Topology 22 (1983)",
    ),
    CatalogEntry(
        "jorge-meeks",
        classical.jorge_meeks,
        "the k-noid of Jorge and Meeks, with any number of ends",
        "Jorge, Meeks, Topology 22 (1983)",
    ),
)

#: Name -> entry, in the order in which they are listed.
catalog: MappingProxyType[str, CatalogEntry] = MappingProxyType({e.name: e for e in _ENTRIES})


def surface(name: str, **options: Any) -> MinimalSurface:
    """Return a surface of the catalog.

    Parameters
    ----------
    name : str
        One of `catalog`.
    **options
        Those of the entry, and for every surface ``bonnet_angle`` in degrees, which turns it into
        an associate surface.

    Raises
    ------
    SurfaceError
        If the name or an option is unknown, or an option has an impossible value; the message
        lists what exists.

    Examples
    --------
    >>> import phexfab as px
    >>> film = px.minimal_surface("catenoid").scaled(1200.0)  # a neck of 1.2 m radius, in mm
    >>> film.period  # all the way around in v
    6.283185307179586j
    >>> px.minimal_surface("enneper", order=2).name
    'enneper of order 2'
    >>> px.minimal_surface("sherk-1")
    Traceback (most recent call last):
        ...
    phexfab.errors.SurfaceError: there is no surface 'sherk-1'; did you mean 'scherk-1'? ...
    """
    if name not in catalog:
        raise SurfaceError(
            f"there is no surface {name!r};{_suggest(str(name), list(catalog))} "
            f"the catalog has {', '.join(catalog)}"
        )
    entry = catalog[name]
    for key in options:
        if key not in entry.options:
            known = ", ".join(entry.options)
            raise SurfaceError(
                f"{name} has no option {key!r};{_suggest(key, list(entry.options))} "
                f"its options are {known}"
            )
    own = set(inspect.signature(entry.make).parameters)
    angle = options.get("bonnet_angle", 0.0)
    if isinstance(angle, bool) or not isinstance(angle, int | float):
        raise SurfaceError(f"{name}: bonnet_angle must be a number of degrees, not {angle!r}")
    made = entry.make(**{key: value for key, value in options.items() if key in own})
    return associate(made, angle) if angle and "bonnet_angle" not in own else made


#: The same under the name that `phexfab` hands out, where ``phexfab.surface`` is this package.
minimal_surface = surface


def _suggest(word: str, words: list[str]) -> str:
    close = get_close_matches(word.lower(), words, n=1)
    return f" did you mean {close[0]!r}?" if close else ""
