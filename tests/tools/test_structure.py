"""tools/structure: counts what is in a small tree, and its uses are those that the linker sees."""
import importlib.machinery
import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from collector import build_folder
from conftest import ROOT

TOOL = ROOT / "tools" / "structure"

LONG = "static int long_one(void)\n{\n" + "  work();\n" * 60 + "}\n"
MANY = "int ManyArguments(" + ", ".join(f"int a{k}" for k in range(11)) + ")\n{\n  return 0; /* ManyMembers() */\n}\n"
SMALL = {
    "include/base/line.h": "typedef struct {\n  int a, b[2]; /* c; d; */\n  struct {\n    int (*f)(int x, int y), g;\n  } part;\n} Line;\n"
                           "static inline int LineDown(void)\n{\n  return Bottom();\n}\n#define UP(x) Upper(x)\n",
    "src/base/bottom.c": 'int Bottom(void)\n{\n  return table[0] + "Upper()"[0];\n}\nint one = 1, table[2] = {1, 2};\n',
    "src/base/other.c": f"{MANY}\nint Upper(int x)\n{{\n  return LineDown() + one;\n}}\n",
    "src/base/third.c": "int Third(void)\n{\n  return UP(1) + s.Top + s->Top;\n}\n",
    "src/mesh/top.c": f"{LONG}\nint Top(void)\n{{\n  return own() + long_one();\n}}\nint work(void)\n{{\n  Third();\n  Bottom();\n}}\nstatic int own(void)\n{{\n  return Upper(1); /*{'-' * 120}\n{'-' * 121}*/\n}}\n",
}


def load():
    sys.path.insert(0, str(TOOL.parent))
    loader = importlib.machinery.SourceFileLoader("structure", str(TOOL))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("structure", loader))
    loader.exec_module(module)
    return module


STRUCTURE = load()


def plant(folder, files):
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return STRUCTURE.Tree(folder)


@pytest.fixture
def tree(tmp_path):
    return plant(tmp_path, SMALL)


def names(tree):
    return {(a.stem, b.stem): used for a, targets in tree.uses.items() for b, used in targets.items()}


def test_functions_and_structs(tree):
    sizes = {f.name: (f.lines, f.arguments) for f in tree.functions}
    assert sizes == {"Bottom": (4, 0), "ManyArguments": (4, 11), "Upper": (4, 1), "Third": (4, 0), "long_one": (63, 0), "Top": (4, 0), "work": (5, 0), "own": (5, 0), "LineDown": (4, 0)}
    assert sorted((s.name, s.members) for s in tree.structs) == [("Line", 3), ("part", 2)]


def test_uses(tree):
    """Through what a header defines too; not in comments and strings, nor of members."""
    assert names(tree) == {("other", "bottom"): {"Bottom", "one"}, ("third", "other"): {"Upper"}, ("top", "other"): {"Upper"}, ("top", "third"): {"Third"}, ("top", "bottom"): {"Bottom"}}
    assert tree.circles == []


def test_circles(tmp_path):
    turn = {"src/base/bottom.c": SMALL["src/base/bottom.c"] + "\nint Back(void)\n{\n  return Third();\n}\n"}
    tree = plant(tmp_path, {**SMALL, **turn})
    assert [[path.stem for path in circle] for circle in tree.circles] == [["bottom", "other", "third"]]


def test_walk(tree):
    path = tree.walk("Top")
    assert [f.name for f in path] == ["Top", "own", "Upper", "LineDown", "Bottom", "long_one", "work", "Third"]
    stays = STRUCTURE.find_stays(tree, path)
    assert [file.name for file in stays] == ["top.c", "other.c", "line.h", "bottom.c", "top.c", "third.c"]
    assert STRUCTURE.count_climbs([tree.room(file) for file in stays], STRUCTURE.load_below()) == 1


def test_walk_through_tables(tmp_path):
    """A call through a pointer, by itself and in a macro, goes to what the tables hold"""
    files = {"src/base/each.c": "#define EACH(c, verb) \\\n  for (i = 0; i < 2; i++) (*c->op[i].verb)(c); \\\n  c->op->verb(c)\n"
                                "static int first(void)\n{\n  return 1;\n}\nstatic int second(void)\n{\n  return 2;\n}\n"
                                "static const Op OP = {.go = first, .back = second};\nint Each(C c)\n{\n  EACH(c, go);\n  return (*c->op->back)(c);\n}\n"}
    assert [f.name for f in plant(tmp_path, files).walk("Each")] == ["Each", "first", "second"]


def test_walk_by_type(tmp_path):
    """Tables of another type are not followed where the type is to be seen"""
    files = {"src/base/type.h": "typedef struct {\n  int (*go)(void);\n} Op;\ntypedef struct {\n  int (*go)(void);\n} Other;\n",
             "src/base/two.c": "static int first(void)\n{\n  return 1;\n}\nstatic int second(void)\n{\n  return 2;\n}\n"
                               "const Op OP = {.go = first};\nconst Other OTHER = {.go = second};\n",
             "src/base/call.c": "int Call(const Other *o)\n{\n  return o->go();\n}\nint Unseen(void *p)\n{\n  return p->go();\n}\n"}
    tree = plant(tmp_path, files)
    assert [f.name for f in tree.walk("Call")] == ["Call", "second"]
    assert [f.name for f in tree.walk("Unseen")] == ["Unseen", "first", "second"]


def test_words(tmp_path):
    """Words by the parts of a name, not in comments and quoted; those that stay by their patterns; verbs by whole names"""
    files = {"src/base/words.c": '/* dead */ int is_dead(void)\n{\n  return "hollow"[deadline];\n}\nint CellHole(void)\n{\n  return 1;\n}\n'
                                 "static int take(void)\n{\n  return MPI_Probe();\n}\nint take_row, Overtaken, my_probe;\n"}
    tree = plant(tmp_path, files)
    assert {entry: len(paths) for entry, paths in STRUCTURE.find_words(tree).items()} == {
        ("dead", "is_dead"): 1, ("hole", "CellHole"): 1, ("take", "take"): 1, ("probe", "MPI_Probe"): 1, ("take", "take_row"): 1, ("probe", "my_probe"): 1}  # fmt: skip
    faults = "\n".join(STRUCTURE.find_private(tree))
    assert [name for name in ("'is_dead'", "'CellHole'", "'take'", "'MPI_Probe'", "'take_row'", "'my_probe'") if name in faults] == ["'is_dead'", "'take'", "'my_probe'"]
    assert "take() is a verb without its object" in faults
    assert run(tmp_path, "--words").stdout.splitlines()[-1] == "6 identifiers, 6 uses; 4 of them may not have their word"


def run(folder, *words):
    return subprocess.run([TOOL, "--root", folder, *words], capture_output=True, text=True)


def test_check(tree, tmp_path):
    done = run(tmp_path, "--check")
    said = done.stderr.splitlines()
    assert done.returncode == 1 and len(said) == 3, done.stderr
    assert "src/mesh/top.c:1: long_one has 63 lines, more than 60" in said and "src/base/other.c:1: ManyArguments has 11 arguments, more than 10" in said
    assert said[-1] == f"2 of {sum(text.count(chr(10)) for text in SMALL.values())} lines are wider than 120 columns, more than 1 %"
    (tmp_path / "src/mesh/top.c").unlink()
    (tmp_path / "src/base/other.c").write_text("int Upper(int x)\n{\n  return x;\n}\n")
    done = run(tmp_path, "--check")
    assert done.returncode == 0 and not done.stderr


def test_many_members_and_lines(tmp_path):
    plant(tmp_path, {"src/base/big.h": "struct _p_Big {\n" + "".join(f"  int a{k};\n" for k in range(41)) + "};\n" + "\n" * 600})
    done = run(tmp_path, "--check")
    assert done.returncode == 1 and "struct _p_Big has 41 members" in done.stderr and "a file of 643 lines" in done.stderr


def test_uses_are_those_of_the_linker():
    """nm's undefined symbols of every object of the library, and who defines them"""
    tree = STRUCTURE.Tree()
    objects = {build_folder() / "obj" / path.relative_to(ROOT / "src").with_suffix(".o"): path for path in tree.paths if path.suffix == ".c" and path.is_relative_to(ROOT / "src")}
    there = [path for path in objects if path.exists()]
    home, wanted = {}, {}
    for line in subprocess.run(["nm", "-A", *there], capture_output=True, text=True, check=True).stdout.splitlines():
        file, symbol = line.rsplit(":", 1)
        kind, name = symbol.split()[-2:]
        if kind in "TDRB":
            home[name] = objects[Path(file)]
        elif kind == "U":
            wanted.setdefault(objects[Path(file)], set()).add(name)
    linker = {(a, home[name]) for a, all_names in wanted.items() for name in all_names if name in home}
    source = {(a, b) for a, targets in tree.uses.items() for b in targets if a in wanted and b in home.values()}
    kernels = ROOT / "src" / "device"  # names of theirs are made by a macro, once for each memory
    assert len(linker) > 1000 and {(a.name, b.name) for a, b in linker ^ source if kernels not in b.parents} == set()
