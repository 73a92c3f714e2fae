"""The site's Python reference against the module: no public name is missing or without words."""

import re

from cli import ROOT

import diffnea

PAGES = ROOT / "docs" / "reference" / "python"
ENTRY = re.compile(r"^\.\. auto\w+:: (?:diffnea\.)?(\w+)$", re.MULTILINE)


def test_every_public_name_is_on_one_page() -> None:
    names = [name for page in PAGES.glob("*.md") for name in ENTRY.findall(page.read_text("utf-8"))]
    assert len(names) == len(set(names))
    assert set(diffnea.__all__) - set(names) == {"__version__"}
    assert set(names) - set(diffnea.__all__) == {"blackbox"}  # a module beside it


def test_every_public_member_is_documented() -> None:
    bare = [
        f"{name}.{member}"
        for name in diffnea.__all__
        if isinstance(getattr(diffnea, name), type)
        for member, thing in vars(getattr(diffnea, name)).items()
        if not member.startswith("_")
        and (callable(thing) or isinstance(thing, (property, staticmethod)))
        and not getattr(getattr(diffnea, name), member).__doc__
    ]
    assert bare == []
