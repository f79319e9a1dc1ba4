"""The doctor against installations that are broken on purpose, each in a folder of its own."""

import os
import sys

import pytest

from phexfab.cad import doctor as clinic
from phexfab.errors import MissingLibraryError

LIBGL = "libGL.so.1: cannot open shared object file: No such file or directory"


@pytest.fixture
def broken(tmp_path, monkeypatch):
    """Return a function that puts fake modules in front of the installed ones."""

    def write(**modules):
        for name, code in modules.items():
            (tmp_path / name).mkdir(exist_ok=True)
            (tmp_path / name / "__init__.py").write_text(code)
        monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
        monkeypatch.syspath_prepend(str(tmp_path))
        for name in list(sys.modules):
            if name.split(".")[0] in modules:
                monkeypatch.delitem(sys.modules, name)
        return tmp_path

    return write


def test_this_installation_is_sound():
    findings = clinic.doctor()
    assert [f.name for f in findings] == ["wheels", "OCP", "cadquery", "build123d"]
    assert [f for f in findings if not f.ok or f.remedy] == []
    assert findings[1].detail.startswith(("7.", "8."))


def test_doctor_survives_what_it_finds(broken):
    broken(
        OCP="raise ImportError('" + LIBGL + "')",
        cadquery="import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
        build123d="raise ImportError(\"cannot import name 'gp_Pnt' from 'OCP.gp'\")",
    )
    _, kernel, cadquery, build123d = clinic.doctor(timeout=60)
    assert not kernel.ok and "apt-get install libgl1" in kernel.remedy
    assert not cadquery.ok and "signal 11" in cadquery.detail and "pip install" in cadquery.remedy
    assert not build123d.ok and "gp_Pnt" in build123d.detail and "pip install" in build123d.remedy


def test_doctor_gives_up_on_an_import_that_hangs(broken):
    broken(cadquery="import time; time.sleep(60)")
    finding = clinic._probe("cadquery", 0.5)
    assert not finding.ok and "0.5 s" in finding.detail and finding.remedy


@pytest.mark.parametrize("error", ["ImportError", "AttributeError"])
def test_require_says_how_to_repair(broken, error):
    broken(cadquery=f"raise {error}('IVtkOCC_Shape is gone')")
    with pytest.raises(MissingLibraryError, match="IVtkOCC_Shape is gone") as caught:
        clinic.require("cadquery")
    assert "pip install --force-reinstall --no-deps" in str(caught.value)
    assert isinstance(caught.value, ImportError)


def versions(monkeypatch, **installed):
    table = {name.replace("_", "-"): version for name, version in installed.items()}
    monkeypatch.setattr(clinic, "_version", lambda name: table.get(name, ""))


def test_remedies_fit_the_fault(monkeypatch):
    versions(monkeypatch)
    assert clinic.remedy_for("cadquery", "No module named 'cadquery'") == clinic.REINSTALL
    versions(monkeypatch, cadquery="2.8.0", cadquery_ocp="7.9.3", cadquery_ocp_novtk="8.0.1")
    assert "two versions of OCP" in clinic.remedy_for("cadquery", "undefined symbol")
    versions(monkeypatch, cadquery="2.8.0", cadquery_ocp="7.9.3", cadquery_ocp_novtk="7.9.3")
    assert '"cadquery-ocp==7.9.3"' in clinic.remedy_for("cadquery", "cannot import name 'IVtkOCC'")
    unknown = LIBGL.replace("libGL", "libWeird")
    assert "libWeird.so.1" in clinic.remedy_for("OCP", unknown)


def test_wheels_that_cannot_live_together_are_named(monkeypatch):
    versions(monkeypatch)
    assert clinic._check_wheels().remedy == clinic.REINSTALL
    versions(monkeypatch, cadquery_ocp="7.9.3", cadquery_ocp_novtk="8.0.1")
    assert "two versions in one folder" in clinic._check_wheels().detail
    versions(monkeypatch, cadquery="2.8.0", cadquery_ocp_novtk="7.9.3")
    assert "CadQuery needs cadquery-ocp" in clinic._check_wheels().detail


def test_an_overwritten_wheel_shows_by_the_size_of_its_binary(broken):
    folder = broken(OCP="")
    binary = folder / "OCP" / "OCP.so"
    binary.write_bytes(b"0123456789")
    info = folder / "cadquery_ocp-7.9.9.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: cadquery-ocp\nVersion: 7.9.9\n")
    (info / "RECORD").write_text("OCP/__init__.py,,0\nOCP/OCP.so,sha256=x,10\n")
    assert not clinic._overwritten("cadquery-ocp")
    binary.write_bytes(b"the other flavour")
    assert clinic._overwritten("cadquery-ocp")
    binary.unlink()
    assert clinic._overwritten("cadquery-ocp")
