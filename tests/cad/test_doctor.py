"""The doctor against installations that are broken on purpose, each in a folder of its own."""

import os
import platform
import shlex
import sys

import pytest

from phexfab.cad import doctor as clinic
from phexfab.errors import MissingLibraryError, PartError

NAMES = ["python", "wheels", "OCP", "cadquery", "build123d", "system libraries", "self-test"]
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
    assert [f.name for f in findings] == NAMES
    assert [f for f in findings if not f.ok or f.remedy] == []
    assert clinic.repair(findings) == ""
    known = {finding.name: finding.detail for finding in findings}
    assert known["python"].startswith(platform.python_version())
    assert known["OCP"].startswith(("7.", "8."))
    for word in ("panels", "kg", "valid solids", "DXF sheets audited", "checks passed", " s"):
        assert word in known["self-test"]


def test_doctor_survives_what_it_finds(broken):
    broken(
        OCP="raise ImportError('" + LIBGL + "')",
        cadquery="import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
        build123d="raise ImportError(\"cannot import name 'gp_Pnt' from 'OCP.gp'\")",
    )
    findings = clinic.doctor(timeout=60)
    assert [f.name for f in findings] == NAMES
    _, _, kernel, cadquery, build123d, _, trial = findings
    assert not kernel.ok and kernel.remedy == clinic.install_system(["libGL.so.1"])
    assert not trial.ok and "libGL.so.1" in trial.detail and trial.remedy == ""
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
    assert clinic.remedy_for("cadquery", "No module named 'cadquery'") == clinic.reinstall()
    versions(monkeypatch, cadquery="2.8.0", cadquery_ocp="7.9.3", cadquery_ocp_novtk="8.0.1")
    assert clinic.remedy_for("cadquery", "undefined symbol") == clinic.untangle()
    versions(monkeypatch, cadquery="2.8.0", cadquery_ocp="7.9.3", cadquery_ocp_novtk="7.9.3")
    assert '"cadquery-ocp==7.9.3"' in clinic.remedy_for("cadquery", "cannot import name 'IVtkOCC'")
    unknown = LIBGL.replace("libGL", "libWeird")
    assert "libWeird.so.1" in clinic.remedy_for("OCP", unknown)


def test_wheels_that_cannot_live_together_are_named(monkeypatch):
    versions(monkeypatch)
    assert clinic._check_wheels().remedy == clinic.reinstall()
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


def wheel(folder, name, version, content):
    """Install a wheel of one binary by hand, over whatever lies there, as pip does."""
    (folder / "OCP").mkdir(exist_ok=True)
    (folder / "OCP" / "OCP.so").write_bytes(content)
    info = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    (info / "RECORD").write_text(f"OCP/OCP.so,sha256=x,{len(content)}\n")


@pytest.mark.parametrize("order", [("vtk", "novtk"), ("novtk", "vtk")])
@pytest.mark.parametrize("other", ["7.9.9", "8.0.0"])
def test_the_clash_of_the_wheels_in_both_orders(tmp_path, monkeypatch, order, other):
    """The last one wins: harmless only where that is CadQuery's and the versions are one."""
    made = {
        "vtk": ("cadquery-ocp", "7.9.9", b"the kernel with VTK"),
        "novtk": ("cadquery-ocp-novtk", other, b"the kernel"),
    }
    for flavour in order:
        wheel(tmp_path, *made[flavour])
    monkeypatch.syspath_prepend(str(tmp_path))
    finding = clinic._check_wheels()
    if other == "8.0.0":
        assert (finding.ok, finding.remedy) == (False, clinic.untangle())
    elif order == ("vtk", "novtk"):
        assert (finding.ok, finding.remedy) == (False, clinic.force_reinstall())
        assert finding.remedy.endswith('--force-reinstall --no-deps "cadquery-ocp==7.9.9"')
    else:
        assert (finding.ok, finding.remedy) == (True, "")


def test_missing_system_libraries_are_one_command(monkeypatch):
    monkeypatch.setattr(clinic.platform, "system", lambda: "Linux")
    monkeypatch.setattr(clinic.shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setattr(clinic, "_loads", lambda file: "X11" in file)
    finding = clinic._check_system()
    assert not finding.ok and finding.detail == "missing: libGL.so.1, libexpat.so.1"
    assert finding.remedy == "apt-get install -y libgl1 libexpat1"
    monkeypatch.setattr(clinic.shutil, "which", lambda name: None)
    assert "libGL.so.1 libexpat.so.1" in clinic._check_system().remedy
    monkeypatch.setattr(clinic.platform, "system", lambda: "Darwin")
    assert clinic._check_system().ok


def test_system_libraries_are_loaded_for_real():
    assert not clinic._loads("libNoSuchThing.so.7")


def test_one_line_repairs_all(monkeypatch):
    def line(**remedies):
        names = {name.replace("_", "-"): remedy for name, remedy in remedies.items()}
        return clinic.repair(
            [clinic.Finding(name, not remedy, "", remedy) for name, remedy in names.items()]
        )

    assert line(wheels="", OCP="") == ""
    # the clash explains what the libraries say of themselves
    assert line(wheels="pip A", OCP="pip B", cadquery="pip C", build123d="") == "pip A"
    # and so does a missing system library
    both = "apt-get install -y libgl1 libx11-6"
    explained = {
        "OCP": "apt-get install -y libgl1",
        "cadquery": "apt-get install -y libx11-6",
        "numpy": "pip numpy",
        "system libraries": both,
    }
    findings = [clinic.Finding(name, False, "", text) for name, text in explained.items()]
    assert clinic.repair(findings) == f"{both} && pip numpy"
    assert line(wheels="pip A", cadquery="pip A") == "pip A"
    assert line(cadquery="pip C", build123d="pip C") == "pip C"


def test_pip_is_that_of_this_python(monkeypatch):
    monkeypatch.setattr(clinic.shutil, "which", lambda name: "/elsewhere/python")
    assert clinic._pip() == f"{shlex.quote(sys.executable)} -m pip"
    monkeypatch.setattr(clinic.shutil, "which", lambda name: sys.executable)
    assert clinic._pip() == "python -m pip"


def test_an_old_python_is_named(monkeypatch):
    monkeypatch.setattr(clinic, "PYTHON", (9, 9))
    assert clinic._check_python().remedy == "install Python 9.9 or newer"


@pytest.mark.parametrize("fault", ["volume", "lost", "invalid", "check"])
def test_the_self_test_notices(monkeypatch, fault):
    import phexfab.selftest as trial

    if fault == "volume":
        monkeypatch.setattr(trial, "volume", lambda shape: 1.0)
    elif fault == "lost":
        monkeypatch.setattr(trial, "solids_in", lambda shape: [])
    elif fault == "invalid":
        monkeypatch.setattr(trial, "is_valid", lambda shape: False)
    else:
        strict = {**trial.DESIGN, "checks": {"panel_mass": 0.1}}
        monkeypatch.setattr(trial, "DESIGN", strict)
    with pytest.raises(
        PartError, match={"check": "checks of the self-test's shell fail"}.get(fault, "STEP")
    ):
        trial.self_test()
