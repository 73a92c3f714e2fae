"""Which folder may include what, and what a public header may hold.

A forbidden edge is a design decision taken by accident: cheap to see here, dear to undo later.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

EFFECTS_AND_BELOW = ("core", "lie", "model", "dynamics", "effects")
MOTION_AND_BELOW = (*EFFECTS_AND_BELOW, "recording", "motion")
IDENTIFY_AND_BELOW = (*MOTION_AND_BELOW, "identify")
PIPELINE = (*IDENTIFY_AND_BELOW, "excite", "diagnose", "sim", "policy")

# What each folder of include/diffnea/ and src/ may include besides itself: folders or headers. A
# diagnosis replays its two models, and knows no other simulator.
MAY_INCLUDE: dict[str, tuple[str, ...]] = {
    "core": (),
    "lie": ("core",),
    "model": ("core", "lie"),
    "dynamics": ("core", "lie", "model"),
    "effects": ("core", "lie", "model", "dynamics"),
    "recording": ("core",),
    "motion": (*EFFECTS_AND_BELOW, "recording"),
    "identify": MOTION_AND_BELOW,
    "excite": IDENTIFY_AND_BELOW,
    "diagnose": (*IDENTIFY_AND_BELOW, "excite", "sim/replay.hpp"),
    "sim": (*EFFECTS_AND_BELOW, "recording"),
    "policy": ("core", "sim/simulator.hpp"),
    "experiment": PIPELINE,
    "io": (*EFFECTS_AND_BELOW, "recording", "sim/mujoco_model.hpp"),
    "worlds": (*EFFECTS_AND_BELOW, "recording", "io", "sim"),
    "runs": (*PIPELINE, "experiment", "io", "worlds"),
    "report": ("core", "effects", "identify", "diagnose", "io", "runs"),
}

# Private headers that these folders may include besides their own: of the rest they see the public
# value types alone.
PRIVATE_OF: dict[str, tuple[str, ...]] = {
    "runs": ("core/", "io/"),
    "report": ("core/",),
}

# Libraries and where they are at home: the first prefix that fits counts, all others are refused.
PUBLIC_HEADERS = "include"
PUBLIC = ("Eigen/", "ceres/jet.h", "experimental/simd")
LIBRARIES: dict[str, tuple[str, ...]] = {
    # Compiled once: core/decompositions.hpp.
    "Eigen/Cholesky": ("include", "src/core"),
    "Eigen/Dense": ("include", "src/core"),
    "Eigen/Eigenvalues": ("include", "src/core"),
    "Eigen/LU": ("include", "src/core", "python"),
    "Eigen/QR": ("include", "src/core"),
    "Eigen/SVD": ("include", "src/core"),
    "Eigen/": ("include", "src", "python"),
    "ceres/jet.h": ("include", "src"),
    "experimental/simd": ("include/diffnea/core",),
    "ceres/": ("src/identify",),
    "mujoco/": ("src/sim", "src/io", "src/worlds"),
    "console_bridge/": ("src/io",),
    "nlohmann/": ("src/io", "src/runs", "src/worlds"),
    "urdf_parser/": ("src/io",),
    "urdf_model/": ("src/io",),
    "urdf_world/": ("src/io",),
    "tinyxml": ("src/io",),
    "CLI/": ("apps",),
    "pybind11/": ("python",),
    # of the system
    "dlfcn.h": ("src/worlds",),
    "fcntl.h": ("src/core", "apps"),
    "locale.h": ("src/core",),
    "sys/": ("src/core", "apps"),
    "spawn.h": ("apps",),  # Python, which reads other formats
    "unistd.h": ("src/core", "src/runs", "apps"),
}

COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.MULTILINE)


def sources(root: Path, *folders: str) -> Iterator[Path]:
    for folder in folders:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in {".hpp", ".h", ".cpp", ".cc", ".inl"}:
                yield path


def resolve(root: Path, source: Path, name: str) -> tuple[str, str] | None:
    """Return a header of ours as (``include``, ``dynamics/rnea.hpp``), and None for a foreign one.

    Private headers are of ``src``, those of programs of no base: ("", ``apps/common.hpp``).
    """
    if name.startswith("diffnea/"):
        return "include", name.removeprefix("diffnea/")
    for folder in (source.parent, root / "src"):
        target = (folder / name).resolve()
        if target.is_file():
            for base, path in (("include", root / "include" / "diffnea"), ("src", root / "src")):
                if target.is_relative_to(path.resolve()):
                    return base, target.relative_to(path.resolve()).as_posix()
            return "", target.relative_to(root.resolve()).as_posix()
    return None


def is_below(path: str, folders: tuple[str, ...]) -> bool:
    return any(path.startswith(f"{folder}/") for folder in folders)


def external_error(place: str, name: str) -> str | None:
    """Why ``place`` (a path below the root) may not include the foreign header ``name``."""
    if "/" not in name and not name.endswith((".h", ".hpp")):
        return None  # the standard library
    if place.startswith(f"{PUBLIC_HEADERS}/") and not name.startswith(PUBLIC):
        return "a public header may include Eigen, ceres/jet.h and the standard library"
    for prefix, homes in LIBRARIES.items():
        if name.startswith(prefix):
            return None if is_below(place, homes) else f"belongs in {' or '.join(homes)}"
    return "is a header of no library that has a home here"


def internal_error(place: str, folder: str, base: str, target: str) -> str | None:
    """Why a file of ``folder`` may not include the header ``target`` of ours."""
    if base == "src" and not place.startswith("src/"):
        return "src/ is private to the library"
    private = PRIVATE_OF.get(folder)
    if base == "src" and private and not target.startswith((f"{folder}/", *private)):
        return f"of private headers {folder} may include {', '.join(private)}"
    if target.startswith(("apps/", "python/", "tests/")):
        own = target.split("/")[0] == folder
        return None if own else "nothing else includes apps, python or tests"
    target_folder, _, rest = target.rpartition("/")
    target_folder = target_folder.split("/")[0]
    if "detail/" in f"/{target}" and target_folder != folder:
        return f"detail/ is private to {target_folder}"
    if not target_folder:
        # diffnea/version.hpp is everybody's; an umbrella header is for users.
        return (
            None
            if rest == "version.hpp" or folder in {"apps", "python"}
            else "the umbrella header is for users"
        )
    if folder in {"apps", "python", ""} or target_folder == folder:
        return None
    allowed = MAY_INCLUDE[folder]
    if target_folder in allowed or target in allowed:
        return None
    return f"{folder} may include {', '.join(allowed) or 'nothing of ours'}"


def folder_of(place: str) -> str:
    """Return ``dynamics`` for src/dynamics/rnea.cpp, ``apps`` for apps/main.cpp."""
    if is_below(place, ("apps", "python")):
        return place.split("/")[0]
    inner = place.removeprefix("include/diffnea/").removeprefix("src/")
    return inner.split("/")[0] if "/" in inner else ""


def violations(root: Path) -> list[str]:
    found = []
    for source in sources(root, "include", "src", "apps", "python"):
        place = source.relative_to(root).as_posix()
        folder = folder_of(place)
        if folder not in {*MAY_INCLUDE, "apps", "python", ""}:
            found.append(f"{place}: {folder}/ is not in the table of folders")
            continue
        text = source.read_text(encoding="utf-8")
        for match in INCLUDE.finditer(text):
            name = match[2]
            target = resolve(root, source, name)
            error = (
                external_error(place, name)
                if target is None
                else internal_error(place, folder, *target)
            )
            if error:
                line = text.count("\n", 0, match.start(1)) + 1
                found.append(f"{place}:{line}: includes {name}: {error}")
    return found


def test_no_forbidden_include() -> None:
    assert violations(ROOT) == []


ALLOWED = {
    "include/diffnea/core/scalar.hpp": "#include <ceres/jet.h>\n#include <Eigen/Core>\n",
    "include/diffnea/dynamics/rnea.hpp": (
        '#include <vector>\n#include "diffnea/model/tree.hpp"\n#include "detail/rnea_impl.hpp"\n'
    ),
    "include/diffnea/dynamics/detail/rnea_impl.hpp": "#include <diffnea/lie/se3.hpp>\n",
    "include/diffnea/policy/promp.hpp": '#include "diffnea/sim/simulator.hpp"\n',
    "include/diffnea/diffnea.hpp": '#include "diffnea/report/page.hpp"\n',
    "src/dynamics/rnea.cpp": (
        '#include "diffnea/dynamics/detail/rnea_impl.hpp"\n#include "diffnea/version.hpp"\n'
    ),
    "src/identify/solver.cpp": "#include <ceres/ceres.h>\n",
    "src/io/mjcf.cpp": "#include <mujoco/mujoco.h>\n#include <nlohmann/json.hpp>\n",
    "src/identify/passes.hpp": "",
    "src/diagnose/base.cpp": "#include <identify/passes.hpp>\n#include <Eigen/Core>\n",
    "src/core/file.cpp": "#include <unistd.h>\n#include <sys/stat.h>\n",
    "apps/main.cpp": '#include <CLI/CLI.hpp>\n#include "diffnea/diffnea.hpp"\n',
    "python/module.cpp": "#include <pybind11/pybind11.h>\n",
}

FORBIDDEN = {
    "an upward edge": ("src/dynamics/bad.cpp", '#include "diffnea/identify/solver.hpp"'),
    "a sideways edge": ("include/diffnea/recording/bad.hpp", "#include <diffnea/model/tree.hpp>"),
    "a policy that knows the world": (
        "src/policy/bad.cpp",
        '#include "diffnea/sim/mujoco_world.hpp"',
    ),
    "a detail header of another folder": (
        "src/effects/bad.cpp",
        '#include "diffnea/dynamics/detail/rnea_impl.hpp"',
    ),
    "a detail header in a command": (
        "apps/bad.cpp",
        "#include <diffnea/dynamics/detail/rnea_impl.hpp>",
    ),
    "Ceres' solver outside identify": ("src/dynamics/bad.cpp", "#include <ceres/ceres.h>"),
    "Ceres' solver in a public header": (
        "include/diffnea/identify/bad.hpp",
        "#  include <ceres/problem.h>",
    ),
    "MuJoCo outside sim and io": ("src/policy/bad.cpp", "#include <mujoco/mujoco.h>"),
    "JSON outside io": ("src/report/bad.cpp", "#include <nlohmann/json.hpp>"),
    "a foreign library in a public header": (
        "include/diffnea/core/bad.hpp",
        "#include <fmt/core.h>",
    ),
    "a private header in a public one": (
        "include/diffnea/diagnose/bad.hpp",
        "#include <identify/passes.hpp>",
    ),
    "a private header in a command": ("apps/bad.cpp", "#include <identify/passes.hpp>"),
    "a private header in the module": ("python/bad.cpp", '#include "../src/identify/passes.hpp"'),
    "what runs read besides value types": ("src/runs/bad.cpp", "#include <identify/passes.hpp>"),
    "results in a file format": ("src/io/bad.cpp", "#include <diffnea/identify/identify.hpp>"),
    "a decomposition compiled again": ("src/diagnose/bad.cpp", "#include <Eigen/QR>"),
    "numerics in a command": ("apps/bad.cpp", "#include <Eigen/Cholesky>"),
    "a library without a home": ("src/dynamics/bad.cpp", "#include <yaml-cpp/yaml.h>"),
    "a library's header without a folder": ("src/io/bad.cpp", "#include <curl.h>"),
    "a log's library outside io": ("src/sim/bad.cpp", "#include <console_bridge/console.h>"),
    "the system in a public header": ("include/diffnea/core/bad.hpp", "#include <unistd.h>"),
    "the system where it has no business": ("src/policy/bad.cpp", "#include <unistd.h>"),
    "CLI11 in the library": ("src/io/bad.cpp", "#include <CLI/CLI.hpp>"),
    "the umbrella header in the library": ("src/io/bad.cpp", "#include <diffnea/diffnea.hpp>"),
    "an application's header": ("src/io/bad.cpp", '#include "../../apps/options.hpp"'),
    "a folder that is in no table": ("src/utils/bad.cpp", "#include <vector>"),
}


def write_tree(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")


def test_checker_accepts_the_table(tmp_path: Path) -> None:
    write_tree(tmp_path, ALLOWED)
    assert violations(tmp_path) == []


@pytest.mark.parametrize("case", FORBIDDEN)
def test_checker_reports(tmp_path: Path, case: str) -> None:
    place, line = FORBIDDEN[case]
    write_tree(tmp_path, ALLOWED | {"apps/options.hpp": "", place: f"\n{line}\n"})
    found = violations(tmp_path)
    assert len(found) == 1
    assert found[0].startswith(f"{place}:")


# --- components

# From the least to the whole; a file may need those at or below its own.
FLOORS = ("identify", "sim", "diffnea")
COMPILED = re.compile(r"diffnea_sources\((\w+)(?: ALONE)?\n([^)]*)\)")


def components(root: Path) -> dict[str, str]:
    """Return the component that each file of src/ is compiled into, by CMake's lists."""
    text = (root / "src" / "CMakeLists.txt").read_text(encoding="utf-8")
    return {file: match[1] for match in COMPILED.finditer(text) for file in match[2].split()}


def upward(root: Path) -> list[str]:
    """Includes of what is compiled into a component above the file's own.

    A header is of the component that the file of its stem is compiled into; without one, of the
    least component of its folder.
    """
    found = components(root)
    floor = {file.removesuffix(".cpp"): FLOORS.index(name) for file, name in found.items()}
    least: dict[str, int] = {}
    for stem, own in floor.items():
        folder = stem.split("/")[0]
        least[folder] = min(own, least.get(folder, own))

    def floor_of(stem: str) -> int:
        return floor.get(stem, least.get(stem.split("/")[0], 0))

    wrong = []
    for source in sources(root, "src"):
        place = source.relative_to(root / "src").as_posix()
        own = floor_of(place.rsplit(".", 1)[0])
        for match in INCLUDE.finditer(source.read_text(encoding="utf-8")):
            target = resolve(root, source, match[2])
            if target and floor_of(target[1].rsplit(".", 1)[0]) > own:
                wrong.append(f"{place} ({FLOORS[own]}) includes {match[2]}")
    return wrong


def test_components_need_those_below() -> None:
    files = {path.relative_to(ROOT / "src").as_posix() for path in (ROOT / "src").rglob("*.cpp")}
    kernels = {"dynamics/batch_kernels.cpp", "sim/pack_world.cpp"}  # once an instruction set
    assert set(components(ROOT)) == files - kernels
    assert set(components(ROOT).values()) <= set(FLOORS)
    assert upward(ROOT) == []


def test_checker_sees_an_upward_component(tmp_path: Path) -> None:
    files = {
        "src/CMakeLists.txt": (
            "diffnea_sources(identify\n  sim/plant.cpp\n)\n"
            "diffnea_sources(sim\n  sim/mujoco.cpp\n)\n"
        ),
        "src/sim/plant.cpp": '#include "sim/mujoco.hpp"\n#include "sim/parts.hpp"\n',
        "src/sim/mujoco.cpp": '#include "sim/parts.hpp"\n',
        "src/sim/mujoco.hpp": "",
        "src/sim/parts.hpp": "",
    }
    write_tree(tmp_path, files)
    assert upward(tmp_path) == ["sim/plant.cpp (identify) includes sim/mujoco.hpp"]


# Explicit instantiations are the library's: without it the user's file makes its own.
def test_extern_templates_are_of_the_compiled_library() -> None:
    for path in sources(ROOT, "include"):
        depth: list[bool] = []
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.startswith("#if"):
                depth.append(line == "#ifdef DIFFNEA_COMPILED")
            elif line.startswith("#endif"):
                depth.pop()
            elif "extern template" in line:
                assert any(depth), f"{path}: outside #ifdef DIFFNEA_COMPILED"


# --- numbers as text

# They hang on the locale of the program, which may be any in a user's; core/c_numbers.hpp has both.
PRINTS = re.compile(r"\bstd::(?:vs?n?printf\b|s?n?printf\([^;]*%[-+ #\d.*]*L?[aefgAEFG])")
READS = re.compile(r"\b(?:strto[dfl]d?|stof|stod|stold|atof|v?sscanf)\b")


def test_numbers_are_written_and_read_with_a_point() -> None:
    for path in sources(ROOT, "src"):
        text = COMMENT.sub("", path.read_text(encoding="utf-8"))
        if path.name == "c_numbers.hpp":
            continue
        if "CNumbers" not in text:
            assert not PRINTS.search(text), f"{path}: use detail::print"
            assert not READS.search(text), f"{path}: use std::from_chars or detail::CNumbers"


# --- public headers


# Types whose alignment hangs on a user's compiler flags: of fixed size, an even number of doubles.
VECTORISABLE = (
    r"Eigen::(?:(?:Vector|RowVector|Array)[24]|(?:Matrix|Array)(?:[24]|22|44)|Quaternion"
    r"|(?:Affine|Isometry|Projective)[23]|Rotation2D|AlignedBox[23])[dfi]\b"
    r"|Eigen::(?:Transform|Quaternion|AlignedBox)<[^;()]*?>"
    r"|Eigen::(?:Matrix|Array)<\s*\w+\s*,\s*(?:\d*[02468]\s*,\s*\d+|\d+\s*,\s*\d*[02468])\b[^;()]*?>"
)
VARIABLE = re.compile(rf"(?:{VECTORISABLE})\s+\w+\s*[;={{,\[]")
INSIDE = re.compile(rf"std::(?:array|optional|pair|tuple|variant)<[^;()]*?(?:{VECTORISABLE})")


def vectorisable(header: str) -> list[str]:
    text = COMMENT.sub("", header)
    return [match[0] for pattern in (VARIABLE, INSIDE) for match in pattern.finditer(text)]


def test_no_public_header_holds_what_flags_align() -> None:
    texts = {path.name: path.read_text() for path in sources(ROOT, "include")}
    # Function bodies alone: their variables are part of no layout.
    found = {name: vectorisable(t) for name, t in texts.items() if "DIFFNEA_INLINE" not in t}
    assert {name: lines for name, lines in found.items() if lines} == {}


@pytest.mark.parametrize(
    "line",
    [
        "Eigen::Vector4d x;",
        "Eigen::Matrix4d x = Eigen::Matrix4d::Identity();",
        "Eigen::Quaterniond turn{1, 0, 0, 0};",
        "Eigen::Isometry3d pose;",
        "Eigen::Matrix<double, 6, 1> twist;",
        "Eigen::Matrix<T, 3, 4> x;",
        "std::array<Eigen::Vector2d, 3> points;",
        "std::optional<Eigen::Matrix<double, 6, 6>> inertia;",
    ],
)
def test_checker_sees_what_flags_align(line: str) -> None:
    assert vectorisable(f"struct S {{\n  {line}\n}};\n")


@pytest.mark.parametrize(
    "line",
    [
        "Eigen::Matrix3d x;",
        "Eigen::Matrix<double, 3, 1> x;",
        "Eigen::Matrix4d pseudo_inertia(const Theta<double>& theta);",
        "void f(const Eigen::Matrix4d& x);",
        "Eigen::Matrix<T, Eigen::Dynamic, 2> x;",
        "std::vector<Eigen::VectorXd> x;",
        "// Eigen::Vector4d x;",
    ],
)
def test_checker_passes_what_they_do_not(line: str) -> None:
    assert not vectorisable(f"struct S {{\n  {line}\n}};\n")


# Where the standard library has what public headers name.
STANDARD = {
    "array": "array",
    "atomic": "atomic",
    "filesystem": "filesystem",
    "function": "functional",
    "map": "map",
    "optional": "optional",
    "pair": "utility",
    "set": "set",
    "shared_ptr": "memory",
    "span": "span",
    "string": "string",
    "string_view": "string_view",
    "tuple": "tuple",
    "uint64_t": "cstdint",
    "unique_ptr": "memory",
    "variant": "variant",
    "vector": "vector",
}
# What a header brings with it by the standard.
BRINGS = {"map": ("utility",), "variant": ("utility",), "string": ("string_view",)}
TEXT = re.compile(r'(?<!include )"(?:[^"\\\n]|\\.)*"')
DECLARES = re.compile(r"^(?:struct|class|enum class|using|concept) ([A-Z]\w*)", re.MULTILINE)


def names_without_header(root: Path) -> list[str]:
    """Names in public headers that are declared in no header which these include.

    Of what a compiler says of each header alone (the study "headers" of ctest) what can be seen at
    once: types of ours, and of the standard library.
    """
    base = root / "include" / "diffnea"
    texts = {
        path.relative_to(base).as_posix(): TEXT.sub(
            '""', COMMENT.sub("", path.read_text(encoding="utf-8"))
        )
        for path in sources(root, "include")
    }
    declared: dict[str, set[str]] = {}
    for name, text in texts.items():
        for match in DECLARES.finditer(text):
            declared.setdefault(match[1], set()).add(name)

    def reached(name: str, seen: set[str]) -> set[str]:
        seen.add(name)
        for match in INCLUDE.finditer(texts.get(name, "")):
            target = match[2].removeprefix("diffnea/")
            if target not in seen and target in texts:
                reached(target, seen)
            seen.add(target)
            seen.update(BRINGS.get(target, ()))
        return seen

    found = []
    for name, text in texts.items():
        if "/detail/" in name:  # included at the end of the header that they belong to
            continue
        seen = reached(name, set())
        for standard in sorted(set(re.findall(r"\bstd::(\w+)", text)) & STANDARD.keys()):
            if STANDARD[standard] not in seen:
                found.append(f"{name}: std::{standard} without <{STANDARD[standard]}>")
        own = set(re.findall(r"\b(?:struct|class|using|concept) (\w+)", text))  # nested ones, too
        named = set(re.findall(r"(?<!::)\b[A-Z]\w*", text))
        for ours in sorted((named - own) & declared.keys()):
            if not declared[ours] & seen:
                found.append(f"{name}: {ours} without {' or '.join(sorted(declared[ours]))}")
    return found


def test_public_headers_include_what_they_name() -> None:
    assert names_without_header(ROOT) == []


def test_checker_sees_names_without_header(tmp_path: Path) -> None:
    tree = "struct Tree {};\n"
    header = "Tree f(std::string name, std::vector<int> x);  // Model\n"
    files = {
        "include/diffnea/model/tree.hpp": "#include <vector>\n" + tree,
        "include/diffnea/model/model.hpp": "struct Model;\n",
        "include/diffnea/io/good.hpp": "#include <diffnea/model/tree.hpp>\n#include <string>\n",
        "include/diffnea/io/bad.hpp": header,
    }
    files["include/diffnea/io/good.hpp"] += header
    write_tree(tmp_path, files)
    assert names_without_header(tmp_path) == [
        "io/bad.hpp: std::string without <string>",
        "io/bad.hpp: std::vector without <vector>",
        "io/bad.hpp: Tree without model/tree.hpp",
    ]
