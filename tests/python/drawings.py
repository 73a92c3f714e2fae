"""Runs the page's drawings without a browser: in mini-racer (V8 as a wheel) or Node.js."""

import html.parser
import json
import shutil
import subprocess
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
from cli import ROOT, SECONDS

SCRIPT = "".join(
    (ROOT / "src/report" / f"{name}.js").read_text(encoding="utf-8")
    for name in ("strokes", "time", "curves", "ball", "movement", "draw")
)
NODE = shutil.which("node")


def evaluate(expression: str) -> Any:
    """Return the value of an expression that Draw is in scope of; skip without an engine."""
    code = f"{SCRIPT}\nJSON.stringify({expression});"
    try:
        from py_mini_racer import MiniRacer
    except ImportError:
        if NODE is None:
            pytest.skip("neither mini-racer (pip) nor node is there to run the drawings")
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "drawings.js")
            file.write_text(f"{SCRIPT}\nconsole.log(JSON.stringify({expression}));")
            answer = subprocess.run(
                [NODE, str(file)], capture_output=True, text=True, timeout=SECONDS, check=True
            )
        return json.loads(answer.stdout)
    with MiniRacer() as engine:
        return json.loads(str(engine.eval(code)))


def draw(kind: str, place: dict[str, Any], page: dict[str, Any]) -> ET.Element:
    """Return one drawing, which is whole: XML without a number that failed."""
    return whole(evaluate(f"Draw.still[{kind!r}]({json.dumps(place)}, {json.dumps(page)})"))


def whole(text: str) -> ET.Element:
    for failed in ("NaN", "undefined", "Infinity", "null"):
        assert failed not in text
    return ET.fromstring(text)


def classes(drawing: ET.Element, tag: str) -> list[str]:
    return [element.get("class", "") for element in drawing.iter(tag)]


class Places(html.parser.HTMLParser):
    """The places of a page that page.js fills, and the page's data."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.places: list[dict[str, Any]] = []
        self.data = ""
        self._keys: list[str] = []  # keys of the texts that follow, which are a bar's
        self._reads_data = False
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        data = {name[5:]: value or "" for name, value in attrs if name.startswith("data-")}
        if "draw" in data:
            self.places.append({**data, "rows": []})
        elif tag == "tr" and "from" in data:
            bar = {
                "from": float(data["from"]),
                "to": float(data["to"]),
                "css": dict(attrs)["class"],
            }
            self.places[-1]["rows"].append(bar)
            self._keys = ["label", "text"]
        self._reads_data = ("id", "data") in attrs

    def handle_data(self, data: str) -> None:
        if self._reads_data:
            self.data += data
        elif self._keys:
            self.places[-1]["rows"][-1][self._keys.pop(0)] = data

    def drawn(self) -> list[tuple[str, ET.Element]]:
        """Return kind and drawing of every place that stands still."""
        still = [place for place in self.places if place["draw"] != "turns"]
        calls = ",".join(f"Draw.still[{p['draw']!r}]({json.dumps(p)}, page)" for p in still)
        texts = evaluate(f"((page) => [{calls}])({self.data})")
        return [(p["draw"], whole(text)) for p, text in zip(still, texts, strict=True)]
