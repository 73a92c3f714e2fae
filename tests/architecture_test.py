"""The include edges of the library against the "may include" table of docs/ARCHITECTURE.md.

A forbidden edge is a design decision taken by accident: cheap to see here, dear to undo later.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

EFFECTS_AND_BELOW = ("core", "lie", "model", "dynamics", "effects")
IDENTIFY_AND_BELOW = (*EFFECTS_AND_BELOW, "recording", "identify")
PIPELINE = (*IDENTIFY_AND_BELOW, "excite", "diagnose", "sim", "policy")

# What each folder of include/diffnea/ and src/ may include besides itself: folders or headers.
MAY_INCLUDE: dict[str, tuple[str, ...]] = {
    "core": (),
    "lie": ("core",),
    "model": ("core", "lie"),
    "dynamics": ("core", "lie", "model"),
    "effects": ("core", "lie", "model", "dynamics"),
    "recording": ("core",),
    "identify": (*EFFECTS_AND_BELOW, "recording"),
    "excite": IDENTIFY_AND_BELOW,
    "diagnose": (*IDENTIFY_AND_BELOW, "excite", "sim/replay.hpp"),
    "sim": (*EFFECTS_AND_BELOW, "recording"),
    "policy": ("core", "sim/simulator.hpp"),
    "experiment": PIPELINE,
    "io": (*PIPELINE, "experiment"),
    "report": ("core", "io"),
}

# Libraries with one home. Where a header is named, the library's other headers stay in that home.
ANYWHERE = ("Eigen/", "ceres/jet.h", "experimental/")
PUBLIC_HEADERS = "include"
HEAVY: dict[str, tuple[str, ...]] = {
    "ceres/": ("src/identify",),
    "mujoco/": ("src/sim", "src/io"),
    "nlohmann/": ("src/io",),
    "urdf_parser/": ("src/io",),
    "urdf_model/": ("src/io",),
    "urdf_world/": ("src/io",),
    "tinyxml": ("src/io",),
    "gif_lib.h": ("src/report",),
    "CLI/": ("apps",),
    "pybind11/": ("python",),
}

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.MULTILINE)


def sources(root: Path, *folders: str) -> Iterator[Path]:
    for folder in folders:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in {".hpp", ".h", ".cpp", ".cc", ".inl"}:
                yield path


def resolve(root: Path, source: Path, name: str) -> str | None:
    """Return a header of ours as ``dynamics/rnea.hpp``, and None for a foreign one."""
    if name.startswith("diffnea/"):
        return name.removeprefix("diffnea/")
    for folder in (source.parent, root / "src"):
        target = (folder / name).resolve()
        if target.is_file():
            for base in (root / "include" / "diffnea", root / "src"):
                if target.is_relative_to(base.resolve()):
                    return target.relative_to(base.resolve()).as_posix()
            return target.relative_to(root.resolve()).as_posix()
    return None


def is_below(path: str, folders: tuple[str, ...]) -> bool:
    return any(path.startswith(f"{folder}/") for folder in folders)


def external_error(place: str, name: str) -> str | None:
    """Why ``place`` (a path below the root) may not include the foreign header ``name``."""
    if "/" not in name and not name.endswith((".h", ".hpp")):
        return None  # the standard library
    if name.startswith(ANYWHERE):
        return None
    for prefix, homes in HEAVY.items():
        if name.startswith(prefix):
            return None if is_below(place, homes) else f"belongs in {' or '.join(homes)}"
    if place.startswith(f"{PUBLIC_HEADERS}/"):
        return "a public header may include Eigen, ceres/jet.h and the standard library"
    return None


def internal_error(place: str, folder: str, target: str) -> str | None:
    """Why a file of ``folder`` may not include the header ``target`` of ours."""
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
                else internal_error(place, folder, target)
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
