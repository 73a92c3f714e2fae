"""The surrogates' files are those of their schema, which refuses what the reader refuses."""

import json
from pathlib import Path

import jsonschema
import pytest

ROOT = Path(__file__).resolve().parents[2]
SCHEMA = json.loads((ROOT / "docs/schema/surrogate.schema.json").read_text())


@pytest.mark.parametrize("name", ["a", "b", "c"])
def test_the_files_follow_the_schema(name: str) -> None:
    jsonschema.validate(json.loads((ROOT / f"models/surrogate_{name}.json").read_text()), SCHEMA)


@pytest.mark.parametrize(
    "wrong", [{"mas": [0, 1]}, {"mass": [-1.5, 0]}, {"viscous": 1}, {"com": -1}]
)
def test_what_the_reader_refuses_is_refused(wrong: dict) -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"schema": "diffnea/surrogate/1", **wrong}, SCHEMA)


def test_c_is_b_with_drives() -> None:
    b, c = (json.loads((ROOT / f"models/surrogate_{x}.json").read_text()) for x in "bc")
    assert {k: v for k, v in c.items() if k in b and k != "summary"} == {
        k: v for k, v in b.items() if k != "summary"
    }
