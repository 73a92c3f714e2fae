"""Nothing is fetched, and no file can bring code along: what the sources may not use."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Modules that reach the network, or run what a file says.
FORBIDDEN_MODULES = {
    "network": {"aiohttp", "ftplib", "http", "httpx", "paramiko", "requests", "smtplib", "socket",
                "socketserver", "ssl", "telnetlib", "urllib", "urllib3", "webbrowser",
                "websockets", "xmlrpc"},
    "code in files": {"cloudpickle", "dill", "joblib", "marshal", "pickle", "shelve", "yaml"},
}  # fmt: skip

# Those that talk to other processes where the user asks for it. Their messages are pickled, so they
# belong between machines that trust each other (docs/reproduce.md).
EXCEPTIONS = {
    "dask": {"python/diffnea/reproduce/executors.py"},
    "distributed": {"python/diffnea/reproduce/executors.py"},
    "mpi4py": {"python/diffnea/reproduce/executors.py"},
    "multiprocessing": {"python/diffnea/reproduce/executors.py"},
    "subprocess": set(),  # snippets of docs/ may run the diffnea command
}

FORBIDDEN_CALLS = {"eval", "exec", "compile", "__import__", "read_pickle", "to_pickle",
                   "os.system", "os.popen", "import_module"}  # fmt: skip
# Optional packages, by names that stand in the code that asks for them.
CALL_EXCEPTIONS = {("python/diffnea/_readers/packages.py", "importlib.import_module")}
# A call that is safe with this argument alone.
REQUIRED_ARGUMENT = {"np.load": ("allow_pickle", False), "numpy.load": ("allow_pickle", False),
                     "torch.load": ("weights_only", True)}  # fmt: skip


def violations(source: str, name: str) -> Iterator[str]:
    """What a Python source uses that it may not."""
    for node in ast.walk(ast.parse(source)):
        modules = []
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            modules = [node.module]
        for module in (m.split(".")[0] for m in modules):
            for what, forbidden in FORBIDDEN_MODULES.items():
                if module in forbidden:
                    yield f"{name}:{node.lineno}: imports {module} ({what})"
            allowed = name in EXCEPTIONS.get(module, {name}) or (
                module == "subprocess" and name.startswith("docs/")
            )
            if not allowed:
                yield f"{name}:{node.lineno}: imports {module}, which EXCEPTIONS does not list here"
        if not isinstance(node, ast.Call):
            continue
        called = ast.unparse(node.func)
        if {called, called.split(".")[-1]} & FORBIDDEN_CALLS and (
            called != "re.compile" and (name, called) not in CALL_EXCEPTIONS
        ):
            yield f"{name}:{node.lineno}: calls {called}"
        if called in REQUIRED_ARGUMENT:
            keyword, value = REQUIRED_ARGUMENT[called]
            given = {k.arg: getattr(k.value, "value", None) for k in node.keywords}
            if given.get(keyword) is not value:
                yield f"{name}:{node.lineno}: calls {called} without {keyword}={value}"


def python_sources() -> list[Path]:
    found = [*(ROOT / "python").rglob("*.py"), *(ROOT / "docs").rglob("*.py")]
    return sorted(found)


@pytest.mark.parametrize("path", python_sources(), ids=lambda p: p.relative_to(ROOT).as_posix())
def test_python_sources_fetch_nothing_and_run_no_foreign_code(path: Path) -> None:
    name = path.relative_to(ROOT).as_posix()
    assert not list(violations(path.read_text(encoding="utf-8"), name))


def test_cpp_sources_open_no_connection_and_start_no_program() -> None:
    forbidden = re.compile(
        r"#include <(sys/socket|netdb|netinet/\w+|arpa/\w+|curl/\w+)\.h>"
        r"|\b(popen|dlopen|execl|execv|execvp|posix_spawn|std::system)\s*\("
    )
    found = []
    for folder in ("include", "src", "apps", "python"):
        for path in sorted((ROOT / folder).rglob("*.[ch]pp")):
            for match in forbidden.finditer(path.read_text(encoding="utf-8")):
                found.append(f"{path.relative_to(ROOT)}: {match.group()}")
    assert not found


@pytest.mark.parametrize(
    "source",
    [
        "import pickle",
        "from urllib.request import urlopen",
        "import requests.adapters",
        "import yaml",
        "import subprocess",
        "np.load(path)",
        "np.load(path, allow_pickle=True)",
        "torch.load(path)",
        "eval(text)",
        "pandas.read_pickle(path)",
    ],
)
def test_what_is_forbidden_is_found(source: str) -> None:
    assert list(violations(source, "somewhere.py"))


def test_pages_of_results_fetch_nothing() -> None:
    """No page that the program writes names another host (but for the namespace of SVG)."""
    address = re.compile(r"""(?:src|href|url)\s*[=(]\s*["']?\s*(?:https?:)?//(?!www\.w3\.org)""")
    for path in sorted((ROOT / "src" / "report").glob("*")):
        assert not address.search(path.read_text(encoding="utf-8")), path
