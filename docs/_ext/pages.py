"""Names of pages that stand as code in a text become links to them, such as `docs/theory.md`."""

from pathlib import PurePath

from docutils import nodes
from sphinx import addnodes
from sphinx.transforms import SphinxTransform

OF_THE_PROJECT = {"CONTRIBUTING.md": "contributing", "configs/default.toml": "settings"}


class LinkPages(SphinxTransform):
    """Put a reference, which takes the title of the page, in the place of its name."""

    default_priority = 400

    def apply(self, **_: object) -> None:
        """Change the document."""
        for literal in list(self.document.findall(nodes.literal)):
            name = literal.astext()
            page = OF_THE_PROJECT.get(name)
            if page is None and PurePath(name).suffix == ".md":
                page = name.removeprefix("docs/").removesuffix(".md")
            if page not in self.env.found_docs or page == self.env.docname:
                continue
            if isinstance(literal.parent, nodes.reference | nodes.title):
                continue
            link = addnodes.pending_xref(
                "",
                refdomain="std",
                reftype="doc",
                reftarget=f"/{page}",
                refexplicit=False,
                refwarn=True,
                refdoc=self.env.docname,
            )
            literal.replace_self(link)
            link += literal


def setup(app) -> dict[str, bool]:
    """Add the transform."""
    app.add_transform(LinkPages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
