"""docs/effects against the catalogue: a section for every effect, and nothing stale in it."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from cli import SECONDS, done

DOCS = Path(__file__).resolve().parents[2] / "docs" / "effects"
PAGES = sorted(DOCS.glob("*.md"))
# What a section says, in this order.
PARTS = ("Signature", "Confused with", "Shown by", "Enters", "Source")
SIGNS = {"any": "any", "not negative": "≥ 0", "positive": "> 0"}
BALL = {"ball", "string", "camera"}
# Where the overview says a shorter word than the command.
PLACES = {"joint,joint": "i,j"}

EFFECTS = {e["effect"]: e for e in json.loads(done("effects", "--json"))["effects"]}


def typeset(unit: str) -> str:
    """Return a unit of result files as the pages write it."""
    if unit == "1":
        return "–"
    return unit.replace("*", "·").replace("^2", "²").replace("^0.5", "^½")


def sections() -> dict[str, tuple[str, str]]:
    """Page and text of every section whose heading is a name in backticks."""
    out: dict[str, tuple[str, str]] = {}
    for page in PAGES:
        parts = re.split(r"^## `(\w+)`$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
        for name, text in zip(parts[1::2], parts[2::2], strict=True):
            assert name not in out, f"{name} has two sections"
            # A chapter of another kind ends the section.
            out[name] = page.name, re.split(r"^## ", text, flags=re.MULTILINE)[0]
    return out


SECTIONS = sections()


def rows(text: str, header: str) -> list[list[str]]:
    """Cells of the table that begins with this header."""
    lines = text.splitlines()
    begin = next(i for i, line in enumerate(lines) if line.startswith(header))
    out = []
    for line in lines[begin + 2 :]:
        if not line.startswith("|"):
            break
        out.append([cell.strip() for cell in line.strip().strip("|").split(" | ")])
    return out


def test_every_effect_has_a_section_and_every_section_an_effect() -> None:
    assert set(SECTIONS) == set(EFFECTS)


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_parameters_are_those_of_the_catalogue(name: str) -> None:
    of_ball = EFFECTS[name]["place"] in BALL
    table = rows(SECTIONS[name][1], "| parameter |")
    told = [row[: 3 if of_ball else 4] for row in table]
    expected = []
    for p in EFFECTS[name]["parameters"]:
        units = [typeset(p["unit"])]
        if not of_ball:
            units.append(typeset(p["unit_prismatic"]))
        expected.append([f"`{p['name']}`", *units, SIGNS[p["sign"]]])
    assert told == expected


def plain(number: float) -> str:
    return f"{number:,.10g}".replace(",", " ") if number >= 1e4 else f"{number:.10g}"


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_initial_values_are_told(name: str) -> None:
    """The page says a value wherever it is not 0, that of a sliding joint where it differs."""
    table = rows(SECTIONS[name][1], "| parameter |")
    for p, row in zip(EFFECTS[name]["parameters"], table, strict=True):
        if p["initial"] == 0.0:
            continue
        text = row[-1]
        if name == "cable_differential_friction" and p["name"] == "ratio":
            assert "1/1.68" in text
            continue
        assert plain(p["initial"]) in text
        if p["initial_prismatic"] != p["initial"]:
            assert f"{plain(p['initial'])}, {plain(p['initial_prismatic'])}" in text


@pytest.mark.parametrize("name", sorted(EFFECTS))
def test_a_section_says_what_it_has_to(name: str) -> None:
    text = SECTIONS[name][1]
    at = [text.find(f"**{part}.**") for part in PARTS]
    assert -1 not in at
    assert at == sorted(at)
    assert re.search(r"^\$\$ .+ \$\$ \(effect-[a-z-]+\)$", text, flags=re.MULTILINE)
    assert f"(../_generated/effects/{name}.svg)" in text
    assert f"(../../include/diffnea/effects/{name}.hpp)" in text


def test_the_overview_lists_all_with_their_places() -> None:
    overview = (DOCS / "index.md").read_text(encoding="utf-8")
    listed = {}
    for row in rows(overview, "| effect |"):
        match = re.fullmatch(r"\[`(\w+)`\]\((\w+\.md)#(\w+)\)", row[0])
        assert match is not None, row[0]
        name, page, anchor = match.groups()
        assert (page, anchor) == (SECTIONS[name][0], name)
        listed[name] = row[3]
    places = {e: PLACES.get(i["place"], i["place"]) for e, i in EFFECTS.items()}
    assert listed == places
    assert list(listed) == sorted(listed)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_what_stands_in_backticks_exists(page: Path) -> None:
    """Words with an underscore are effects, parameters, faults, channels or options that exist."""
    known = set(EFFECTS)
    for e in EFFECTS.values():
        known |= {p["name"] for p in e["parameters"]}
    root = DOCS.parents[1]
    recordings = (root / "docs" / "recordings.md").read_text(encoding="utf-8")
    for word in set(re.findall(r"`([a-z]+(?:_[a-z]+)+)`", page.read_text(encoding="utf-8"))):
        assert word in known or re.search(rf"\b{word}\b", recordings), word


@pytest.mark.parametrize("page", [*PAGES, DOCS.parent / "mathematics.md"], ids=lambda p: p.stem)
def test_links_to_files_and_chapters_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text):
        if "_generated/" not in target:  # made with the documentation
            assert (page.parent / target).resolve().is_file(), target
    for target, anchor in re.findall(r"\]\(([^)#]*\.md)#([^)]+)\)", text):
        headings = re.findall(
            r"^#+ (.+)$", (page.parent / target).read_text(encoding="utf-8"), flags=re.MULTILINE
        )
        slugs = {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}
        assert anchor in slugs, f"{target}#{anchor}"


def test_references_to_equations_have_their_equation() -> None:
    pages = [*PAGES, DOCS.parent / "mathematics.md"]
    labels: list[str] = []
    used: set[str] = set()
    for page in pages:
        text = page.read_text(encoding="utf-8")
        labels += re.findall(r"^\$\$ .+ \$\$ \(([a-z0-9-]+)\)$", text, flags=re.MULTILINE)
        used |= set(re.findall(r"\{eq\}`([^`]+)`", text))
    assert len(labels) == len(set(labels))
    assert used <= set(labels)


FIGURES = DOCS.parent / "figures"


def test_pictures_are_made(tmp_path: Path) -> None:
    """Of a torque, of a channel, of a simulated and of a seen path."""
    names = ["coulomb_friction", "velocity_filter_lag", "wind", "camera_scale"]
    subprocess.run(
        [sys.executable, FIGURES / "effect_signatures.py", tmp_path, *names],
        check=True,
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
        timeout=SECONDS,
    )
    assert sorted(p.stem for p in tmp_path.iterdir()) == sorted(names)
    for picture in tmp_path.iterdir():
        assert "</svg>" in picture.read_text(encoding="utf-8")


def test_every_effect_has_its_picture() -> None:
    told = "".join((FIGURES / f"{f}_signatures.py").read_text() for f in ("effect", "ball"))
    drawn = set(re.findall(r'^    "(\w+)": ', told, flags=re.MULTILINE))
    assert set(EFFECTS) <= drawn
