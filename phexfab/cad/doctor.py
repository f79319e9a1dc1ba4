"""Do the CAD libraries load, and do they fit together? If not: what to type.

``cadquery-ocp`` (CadQuery) and ``cadquery-ocp-novtk`` (build123d) unpack into the same ``OCP``
folder, so the one installed last wins; and every flavour needs a few system libraries. Both go
wrong with messages that name neither cause nor cure.
"""

from __future__ import annotations

import importlib
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from types import ModuleType

from phexfab.errors import MissingLibraryError

SYSTEM_PACKAGES = {
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libexpat.so.1": "libexpat1",
    "libXrender.so.1": "libxrender1",
    "libfontconfig.so.1": "libfontconfig1",
}
"""Debian's package for each system library that the wheels load."""

REINSTALL = 'python -m pip install --upgrade "cadquery>=2.8" "build123d>=0.12,<0.13"'
"""Resolves all three in one command, the only order-safe way."""

UNTANGLE = f'{REINSTALL} && python -m pip install --force-reinstall --no-deps "cadquery-ocp<8"'
"""For two versions over each other: removing one of them takes files of the other along."""

# What importing proves; the kernel's own package imports even when half of it was overwritten.
_PROBES = {"OCP": "OCP.BRepPrimAPI", "cadquery": "cadquery", "build123d": "build123d"}
_WHEELS = ("cadquery-ocp", "cadquery-ocp-novtk", "cadquery-ocp-proxy")
_MISSING_FILE = re.compile(r"(lib[\w.+-]+\.so[.\d]*): cannot open shared object file")


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes
    ----------
    name : str
        ``OCP``, ``cadquery``, ``build123d`` or ``wheels``.
    ok : bool
    detail : str
        The version, or what is wrong.
    remedy : str
        What to do, "" when nothing needs doing.
    """

    name: str
    ok: bool
    detail: str
    remedy: str = ""


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""


def force_reinstall() -> str:
    """Return the command that puts CadQuery's flavour of OCP back on top, at its version."""
    version = _version("cadquery-ocp") or _version("cadquery-ocp-novtk")
    pin = f"=={version}" if version else ""
    return f'python -m pip install --force-reinstall --no-deps "cadquery-ocp{pin}"'


def remedy_for(library: str, message: str) -> str:
    """Return what to do about an import of ``library`` that failed with ``message``."""
    missing = _MISSING_FILE.search(message)
    if missing:
        file = missing.group(1)
        package = SYSTEM_PACKAGES.get(file)
        install = f"apt-get install {package}" if package else f"the package that holds {file}"
        return f"install a system library: {install}"
    wheels = {name: _version(name) for name in _WHEELS[:2]}
    if not any(wheels.values()) or not _version("cadquery" if library == "OCP" else library):
        return REINSTALL
    if len(set(filter(None, wheels.values()))) > 1:
        return f"{UNTANGLE} (two versions of OCP lie over each other)"
    if wheels["cadquery-ocp"]:
        return f"{force_reinstall()} (the two flavours of OCP share a folder; the last one wins)"
    return REINSTALL


def require(library: str) -> ModuleType:
    """Import ``OCP``, ``cadquery`` or ``build123d`` and return it.

    Raises
    ------
    MissingLibraryError
        With what failed and how to repair it.
    """
    try:
        importlib.import_module(_PROBES[library])
    except (ImportError, AttributeError) as error:
        # A half-overwritten OCP lacks names as often as modules, hence AttributeError too.
        raise MissingLibraryError(
            f"{library} does not load: {error}. Repair: {remedy_for(library, str(error))}. "
            "`phexfab doctor` tells more."
        ) from error
    return sys.modules[library]


def _probe(library: str, timeout: float) -> Finding:
    """Import a library in another process, which may crash without taking this one along."""
    code = f"import {_PROBES[library]}, {library}; print({library}.__version__)"
    environment = {**os.environ, "PYTHONFAULTHANDLER": "0"}
    try:
        run = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            timeout=timeout,
            env=environment,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Finding(library, False, f"did not load within {timeout:g} s", force_reinstall())
    if run.returncode == 0:
        return Finding(library, True, run.stdout.strip().splitlines()[-1])
    if run.returncode < 0:
        detail = f"crashes on import (signal {-run.returncode})"
    else:
        detail = (run.stderr.strip().splitlines() or ["fails without a message"])[-1]
    return Finding(library, False, detail, remedy_for(library, run.stderr))


def _overwritten(distribution: str) -> bool:
    """Return True when a wheel's compiled module is no longer the file that it installed."""
    files = metadata.distribution(distribution).files or []
    binaries = [f for f in files if str(f.parent) == "OCP" and f.suffix in (".so", ".pyd")]
    paths = [(f.size, Path(str(f.locate()))) for f in binaries]
    return any(not path.exists() or path.stat().st_size != size for size, path in paths)


def _check_wheels() -> Finding:
    """Compare the installed flavours of OCP with each other and with what the libraries want."""
    wheels = {name: _version(name) for name in _WHEELS}
    present = {name: version for name, version in wheels.items() if version}
    detail = ", ".join(f"{name} {version}" for name, version in present.items()) or "none"
    flavours = [wheels[name] for name in _WHEELS[:2] if wheels[name]]
    if not flavours:
        return Finding("wheels", False, "no OCP wheel is installed", REINSTALL)
    if len(set(flavours)) > 1:
        return Finding("wheels", False, f"{detail}: two versions in one folder", UNTANGLE)
    if _version("cadquery") and not wheels["cadquery-ocp"]:
        return Finding("wheels", False, f"{detail}: CadQuery needs cadquery-ocp", REINSTALL)
    if wheels["cadquery-ocp"] and _overwritten("cadquery-ocp"):
        detail = f"{detail}: cadquery-ocp is overwritten by the other flavour"
        return Finding("wheels", False, detail, force_reinstall())
    return Finding("wheels", True, detail)


def doctor(timeout: float = 180.0) -> list[Finding]:
    """Look at the CAD libraries from outside and say how to repair what is broken.

    Takes some ten seconds: each library is imported in a process of its own, so that a crash or a
    clash shows as a finding. Nothing is changed.

    Parameters
    ----------
    timeout : float
        Seconds that one import may take.

    Returns
    -------
    list of Finding
        The wheels, then OCP, cadquery and build123d.
    """
    return [_check_wheels(), *(_probe(library, timeout) for library in _PROBES)]
