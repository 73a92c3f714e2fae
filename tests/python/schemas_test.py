"""Output of commands against the schemas that come from the field lists."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from cli import PENDULUM, done, schema

from diffnea import _core


def printed(*arguments: object) -> dict[str, object]:
    answer: dict[str, object] = json.loads(done(*arguments, "--json"))
    return answer


def check(answer: dict[str, object]) -> None:
    kind = str(answer["schema"]).split("/")[1]
    jsonschema.validate(answer, schema(kind))
    # In their order, none missing and none without a word about it.
    assert list(answer) == list(schema(kind)["properties"])


def test_a_motion_a_recording_and_a_model(tmp_path: Path) -> None:
    motion, data = tmp_path / "motion.csv", tmp_path / "data.csv"
    quick = ("--iterations", 0, "--duration", 4, "--quiet")
    check(printed("excite", PENDULUM, *quick, "-o", motion))
    check(printed("simulate", PENDULUM, "--trajectory", motion, "--quiet", "-o", data))
    check(printed("audit", data))
    check(printed("export", PENDULUM, "-o", tmp_path / "model.json"))


def test_a_run_its_page_and_its_comparison(run: Path) -> None:
    for name in ("result.json", "series.json"):
        check(json.loads((run / name).read_text(encoding="utf-8")))
    check(printed("compare", run, run))
    check(printed("report", run))


def has_meaning(value: Any) -> bool:
    if value.get("description"):
        return True
    inner = value.get("prefixItems", list(value.get("properties", {}).values()))
    return bool(inner) and all(map(has_meaning, inner))


@pytest.mark.parametrize("name", _core._schema_names())
def test_every_key_has_a_meaning(name: str) -> None:
    of_file = schema(name)
    jsonschema.Draft202012Validator.check_schema(of_file)
    for each in (of_file, *of_file["$defs"].values()):
        keys = each["properties"].items()
        assert [key for key, value in keys if not has_meaning(value)] in ([], ["schema"])
