"""Do the CAD libraries load, and do they fit together? If not: the one line to type.

``cadquery-ocp`` (CadQuery) and ``cadquery-ocp-novtk`` (build123d) unpack into the same ``OCP``
folder, so the one installed last wins; and every flavour needs a few system libraries. Both go
wrong with messages that name neither cause nor cure.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
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
"""Debian's package for each system library that a wheel may ask for."""
NEEDED = ("libGL.so.1", "libX11.so.6", "libexpat.so.1")
"""What the wheels of today load, on Linux; on macOS and Windows they bring all along."""
PYTHON = (3, 11)

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
        ``python``, ``wheels``, ``OCP``, ``cadquery``, ``build123d``, ``system libraries``,
        ``self-test``.
    ok : bool
    detail : str
        The version or the figures, or what is wrong.
    remedy : str
        What to type, "" when nothing needs doing.
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


def _pip() -> str:
    """Return how this Python's pip is called from the shell: by a path where ``python`` is none."""
    found = shutil.which("python")
    same = found is not None and Path(found) == Path(sys.executable)
    return f"{'python' if same else shlex.quote(sys.executable)} -m pip"


def reinstall() -> str:
    """Return the command that resolves both CAD libraries at once, the only order-safe way."""
    return f'{_pip()} install --upgrade "cadquery>=2.8" "build123d>=0.12,<0.13"'


def untangle() -> str:
    """Return the line for two versions over each other: to remove one takes the other's files."""
    kernel = f'{_pip()} install --force-reinstall --no-deps "cadquery-ocp<8"'
    return f"{reinstall()} && {kernel}"


def force_reinstall() -> str:
    """Return the command that puts CadQuery's flavour of OCP back on top, at its version."""
    version = _version("cadquery-ocp") or _version("cadquery-ocp-novtk")
    pin = f"=={version}" if version else ""
    return f'{_pip()} install --force-reinstall --no-deps "cadquery-ocp{pin}"'


def install_system(files: Sequence[str]) -> str:
    """Return how to install system libraries: a command where the system is Debian's kind."""
    packages = [SYSTEM_PACKAGES.get(file, "") for file in files]
    if all(packages) and shutil.which("apt-get"):
        return f"apt-get install -y {' '.join(packages)}"
    return f"install the packages of this system that hold {' '.join(files)}"


def remedy_for(library: str, message: str) -> str:
    """Return what to do about an import of ``library`` that failed with ``message``."""
    missing = _MISSING_FILE.search(message)
    if missing:
        return install_system([missing.group(1)])
    wheels = {name: _version(name) for name in _WHEELS[:2]}
    if not any(wheels.values()) or not _version("cadquery" if library == "OCP" else library):
        return reinstall()
    if len(set(filter(None, wheels.values()))) > 1:
        return untangle()
    return force_reinstall() if wheels["cadquery-ocp"] else reinstall()


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


def _run(arguments: Sequence[str], timeout: float) -> subprocess.CompletedProcess[str] | None:
    """Run Python in another process, which may crash without taking this one; None if it hangs."""
    environment = {**os.environ, "PYTHONFAULTHANDLER": "0"}
    try:
        return subprocess.run(
            [sys.executable, *arguments],
            capture_output=True,
            text=True,
            timeout=timeout,
            env=environment,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return None


def _failure(run: subprocess.CompletedProcess[str]) -> str:
    if run.returncode < 0:
        return f"crashes (signal {-run.returncode})"
    return (run.stderr.strip().splitlines() or ["fails without a message"])[-1]


def _probe(library: str, timeout: float) -> Finding:
    code = f"import {_PROBES[library]}, {library}; print({library}.__version__)"
    run = _run(["-c", code], timeout)
    if run is None:
        return Finding(library, False, f"did not load within {timeout:g} s", force_reinstall())
    if run.returncode == 0:
        return Finding(library, True, run.stdout.strip().splitlines()[-1])
    return Finding(library, False, _failure(run), remedy_for(library, run.stderr))


def _check_python() -> Finding:
    detail = f"{platform.python_version()}, {platform.system()} {platform.machine()}"
    detail = f"{detail}, {sys.executable}"
    if sys.version_info[:2] >= PYTHON:
        return Finding("python", True, detail)
    wanted = ".".join(map(str, PYTHON))
    return Finding("python", False, detail, f"install Python {wanted} or newer")


def _loads(file: str) -> bool:
    try:
        ctypes.CDLL(file)
    except OSError:
        return False
    return True


def _check_system() -> Finding:
    if platform.system() != "Linux":
        return Finding("system libraries", True, "all come with the wheels")
    missing = [file for file in NEEDED if not _loads(file)]
    if missing:
        detail = f"missing: {', '.join(missing)}"
        return Finding("system libraries", False, detail, install_system(missing))
    return Finding("system libraries", True, ", ".join(NEEDED))


def _self_test(timeout: float) -> Finding:
    """Build something small for real; what fails there has a finding with a remedy above."""
    run = _run(["-m", "phexfab.selftest"], timeout)
    if run is None:
        return Finding("self-test", False, f"did not end within {timeout:g} s")
    if run.returncode != 0:
        return Finding("self-test", False, _failure(run))
    return Finding("self-test", True, json.loads(run.stdout.splitlines()[-1]))


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
        return Finding("wheels", False, "no OCP wheel is installed", reinstall())
    if len(set(flavours)) > 1:
        return Finding("wheels", False, f"{detail}: two versions in one folder", untangle())
    if _version("cadquery") and not wheels["cadquery-ocp"]:
        return Finding("wheels", False, f"{detail}: CadQuery needs cadquery-ocp", reinstall())
    if wheels["cadquery-ocp"] and _overwritten("cadquery-ocp"):
        detail = f"{detail}: cadquery-ocp is overwritten by the other flavour"
        return Finding("wheels", False, detail, force_reinstall())
    return Finding("wheels", True, detail)


def doctor(timeout: float = 180.0) -> list[Finding]:
    """Look at Python, the CAD libraries and the system, and say how to repair what is broken.

    Takes some ten to twenty seconds: each library is imported in a process of its own, so that a
    crash or a clash shows as a finding, and a small shell is built in another. Nothing is changed.

    Parameters
    ----------
    timeout : float
        Seconds that one import, or the self-test, may take.

    Returns
    -------
    list of Finding
        Python, the wheels, OCP, cadquery, build123d, the system libraries, the self-test.
    """
    return [
        _check_python(),
        _check_wheels(),
        *(_probe(library, timeout) for library in _PROBES),
        _check_system(),
        _self_test(timeout),
    ]


def repair(findings: Sequence[Finding]) -> str:
    """Return the one line that repairs all that was found, "" where nothing needs doing.

    A clash of the wheels is the cause of whatever the libraries say, and a missing system library
    of what asks for it, so these come first, and alone for what they explain.
    """
    bad = {finding.name: finding.remedy for finding in findings if finding.remedy}
    explained = set()
    if "wheels" in bad:
        explained |= set(_PROBES)
    if "system libraries" in bad:
        whole = bad["system libraries"].split()
        explained |= {
            name
            for name, text in bad.items()
            if name in _PROBES and set(text.split()) <= set(whole)
        }
    order = sorted(bad, key=lambda name: name not in ("python", "system libraries"))
    lines = dict.fromkeys(bad[name] for name in order if name not in explained)
    return " && ".join(lines)
