"""Links that work in the repository work in the site.

A header of include/ leads to its page of the C++ reference; a folder to its index, or to that of
the folder above. Other files come along under _downloads: MyST does that.
"""

from pathlib import Path

from cpp_reference import page_of
from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform


class RepositoryLinks(SphinxTransform):
    """Before Sphinx resolves what it takes for references and downloads."""

    default_priority = 5

    def apply(self, **_: object) -> None:
        """Look at every link of a page."""
        for link in list(self.document.findall(addnodes.download_reference)):
            self.header(link)
        for link in list(self.document.findall(addnodes.pending_xref)):
            if link.get("reftype") == "myst":
                self.folder(link)

    def path(self, target: str) -> Path:
        """Return where a link leads."""
        page = Path(self.env.doc2path(self.env.docname))
        return (page.parent / target.partition("#")[0]).resolve()

    def header(self, link: addnodes.download_reference) -> None:
        """Lead to the page of a header that users see."""
        root = Path(self.env.srcdir).parent
        path = self.path(link["reftarget"])
        if path.is_relative_to(root / "include" / "diffnea") and "detail" not in path.parts:
            up = "../" * self.env.docname.count("/")
            reference = nodes.reference(
                "", "", *link.children, internal=False, refuri=up + page_of(root, path)
            )
            link.replace_self(reference)

    def folder(self, link: addnodes.pending_xref) -> None:
        """Lead to the index of a folder."""
        source = Path(self.env.srcdir)
        path = self.path(link["reftarget"])
        if not path.is_dir() or not path.is_relative_to(source):
            return
        while not (path / "index.md").is_file():
            path = path.parent
        link["refdomain"] = "doc"
        link["reftarget"] = (path / "index").relative_to(source).as_posix()
        link["reftargetid"] = None


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the transform."""
    app.add_transform(RepositoryLinks)
    return {"parallel_read_safe": True}
