"""The house's floors: a room imports only from floors below its own, and `import phexfab` is light.

Every import statement counts, also those inside functions; only what a type checker alone reads
(``if TYPE_CHECKING``) may look up.
"""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import phexfab

ROOT = Path(phexfab.__path__[0])
FLOORS = [
    {"errors"},
    {"linalg", "triangular", "whole"},
    {"surface", "mesh", "design"},
    {"parallel"},
    {"remesh"},
    {"minimal", "fabrication"},
    {"cad", "report", "testing"},
    {"delivery", "comparison", "films", "schema", "given_meshes"},
    {"freeform_shells", "placing", "ending"},
    {"fitting"},
    {"forming"},
    {"pipeline"},
    {"compare", "inspection", "plots", "scripting", "selftest"},
    {"cadquery", "build123d"},
    {"cli"},
    {"__init__", "__main__"},
]
FLOOR_OF = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}
HEAVY = ["OCP", "cadquery", "build123d", "ezdxf", "spyrrow", "matplotlib", "manifold3d"]
KERNEL = {"OCP", "cadquery", "build123d"}
MODULES = sorted(ROOT.rglob("*.py"))


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).with_suffix("").as_posix()


def imported_rooms(source: str, module: str) -> list[tuple[int, str]]:
    """Return line and room of every import of our own in a module's source."""
    found = []
    tree = ast.parse(source)
    unread = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for statement in node.body
        for inner in ast.walk(statement)
    }
    for node in ast.walk(tree):
        if id(node) in unread:
            continue
        if isinstance(node, ast.Import):
            names = [alias.name.split(".") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = (node.module or "").split(".") if node.module else []
            if node.level:  # relative: climb from the module's own package
                package = ["phexfab", *module.split("/")[:-1]]
                base = package[: len(package) - node.level + 1] + base
            names = [base] if len(base) > 1 else [[*base, alias.name] for alias in node.names]
        else:
            continue
        for name in names:
            if name[0] == "phexfab":
                room = name[1] if len(name) > 1 else "__init__"
                # A name that is no room is something that phexfab/__init__.py hands out.
                is_room = (ROOT / room).is_dir() or (ROOT / f"{room}.py").exists()
                found.append((node.lineno, room if is_room else "__init__"))
    return found


def trespasses(source: str, module: str) -> list[str]:
    """Return the imports that go up, or across the same floor to another room."""
    home = module.split("/")[0]
    return [
        f"phexfab/{module}.py:{line} imports {room} (floor {FLOOR_OF.get(room)}) from {home} "
        f"(floor {FLOOR_OF.get(home)})"
        for line, room in imported_rooms(source, module)
        if room != home and not FLOOR_OF.get(room, len(FLOORS)) < FLOOR_OF.get(home, 0)
    ]


def test_every_room_has_its_floor():
    rooms = {name_of(path).split("/")[0] for path in MODULES}
    assert rooms - set(FLOOR_OF) == set(), "give the new room a floor in FLOORS"


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_a_room_imports_only_from_floors_below(path):
    assert trespasses(path.read_text(encoding="utf-8"), name_of(path)) == []


@pytest.mark.parametrize(
    ("module", "source", "room"),
    [
        ("surface/catalog", "from phexfab.parallel.shell import Shell", "parallel"),
        ("surface/catalog", "import phexfab.mesh", "mesh"),
        ("mesh/io", "def f():\n    from phexfab import cli", "cli"),
        ("mesh/io", "from phexfab import build", "__init__"),
        ("fabrication/bom", "from ..cad import step", "cad"),
        ("fabrication/bom", "import phexfab", "__init__"),
        ("errors", "from . import mesh", "mesh"),
        ("errors", "if TYPE_CHECKING:\n    x = 1\nelse:\n    from phexfab import mesh", "mesh"),
    ],
)
def test_the_test_sees_a_trespass(module, source, room):
    (line,) = trespasses(source, module)
    assert f"imports {room} " in line


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_the_kernel_lives_in_cad_and_waits_inside_functions(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    at_import = [
        alias.name
        for node in tree.body
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in (
            [ast.alias(node.module or "")] if isinstance(node, ast.ImportFrom) else node.names
        )
    ]
    roots = {name.split(".")[0] for name in at_import}
    if name_of(path).split("/")[0] != "cad":
        assert roots & KERNEL == set()


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_a_module_holds_one_idea(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 400


def loaded_after(statement: str) -> list[str]:
    code = f"import sys\n{statement}\nprint([m for m in {HEAVY} if m in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return ast.literal_eval(ran.stdout)


@pytest.mark.parametrize(
    "statement",
    [
        "import phexfab",
        "import phexfab.cli",
        "import phexfab.pipeline",
        "import phexfab.scripting, phexfab.selftest",
        "import phexfab as p; [getattr(p, name) for name in getattr(p, '__all__', ())]",
    ],
)
def test_importing_phexfab_is_light(statement):
    assert loaded_after(statement) == []


def test_the_light_test_sees_a_heavy_library():
    assert loaded_after("import ezdxf") == ["ezdxf"]
