"""What a folder of results may hold at any moment: whole files, each of its format."""

import csv
import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
from cli import load, schema

HIDDEN = re.compile(r"^\.partial-\d+$|^\..+\.tmp$")
"""What may be there of a program that was killed, until the next one runs."""
TIMES = {
    "seconds",
    "cpu_seconds",
    "seconds_fitting",
    "finished",
    "busy_seconds",
    "busy_share",
    "rollouts_per_second",
    "cpu_hours",
    "hours_on_2_cores",
}
"""Keys of results that no two runs share."""
WITHOUT_SCHEMA = {
    "ball-network",
    "beyond",
    "checkpoint",
    "effects",
    "info",
    "job",
    "learn-series",
    "model",
    "recording",
    "transfer-series",
    "worlds",
}
"""Kinds of files that docs/schema describes in words, or not at all. All others have a schema."""


def files(folder: Path) -> Iterator[Path]:
    """Files that have their names: not the hidden ones."""
    for path in sorted(folder.iterdir()):
        if HIDDEN.match(path.name):
            continue
        if path.is_dir():
            yield from files(path)
        else:
            yield path


def hidden(folder: Path) -> list[Path]:
    return [path for path in folder.rglob(".*") if HIDDEN.match(path.name)]


@cache
def validator(kind: str) -> jsonschema.Draft202012Validator:
    of_kind = schema(kind)
    jsonschema.Draft202012Validator.check_schema(of_kind)
    return jsonschema.Draft202012Validator(of_kind)


def check(folder: Path) -> None:
    """Every file is whole; where there is a result, there is what belongs to it."""
    for path in files(folder):
        try:
            _check(path)
        except Exception as error:
            raise AssertionError(f"{path}: {type(error).__name__}: {error}") from error
        if path.name == "result.json":
            beside = {other.name for other in path.parent.iterdir()}
            assert {"series.json", "model.json", "report.html"} <= beside, path


def _check(path: Path) -> None:
    content = path.read_bytes()
    match path.suffix:
        case ".json":
            value = load(path)
            if "schema" in value:
                kind = re.fullmatch(r"diffnea/([a-z0-9-]+)/1", value["schema"])
                assert kind, value["schema"]
                if kind[1] not in WITHOUT_SCHEMA:
                    validator(kind[1]).validate(value)
        case ".csv":
            assert content.endswith(b"\n")
            widths = {len(row) for row in csv.reader(content.decode().splitlines())}
            assert len(widths) == 1, widths
        case ".html":
            assert content.rstrip().endswith(b"</html>")
        case ".xml" | ".urdf":
            ElementTree.fromstring(content)
        case ".gif":
            assert content.startswith(b"GIF89a")
            assert content.endswith(b";")
        case ".npz":
            with np.load(path, allow_pickle=False) as arrays:
                for name in arrays.files:
                    assert arrays[name].size >= 0
        case ".txt" | ".tex":
            assert content.endswith(b"\n")
        case ".jsonl":  # its last line may be half: who reads it passes over it
            for line in content.splitlines(keepends=True)[:-1]:
                json.loads(line)
        case "":
            assert path.name == "lock"
        case other:
            raise AssertionError(f"files of {other} are not expected")


def without_times(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: without_times(v) for k, v in value.items() if k not in TIMES}
    return [without_times(v) for v in value] if isinstance(value, list) else value


def results(folder: Path) -> dict[str, Any]:
    """By name, all that has to come out again; pages and checkpoints hold times."""
    out: dict[str, Any] = {}
    for path in files(folder):
        name = path.relative_to(folder).as_posix()
        if path.suffix == ".jsonl":  # a run killed behind its last result leaves no line there
            continue
        if "checkpoints/" in name or path.suffix in {".html", ".tex"}:
            out[name] = None
        elif path.name == "table.json":
            out[name] = load(path)["rows"]
        elif path.suffix == ".json":
            out[name] = without_times(load(path))
        elif path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as arrays:
                out[name] = {k: (arrays[k].shape, arrays[k].tobytes()) for k in arrays.files}
        else:
            out[name] = path.read_bytes()
    return out
