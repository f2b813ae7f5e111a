"""Check the built site without a network: `python tests/check_site.py build/site`.

Every link inside it leads to a page and a place that are there, nothing is loaded from elsewhere,
the eight guides are two clicks from the front page at most, every public name has its page with an
example, every example of the gallery has its picture, and options keep both their hyphens.
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import capslip

GUIDES = ("vendor-file", "csv", "mated-faces", "measured-curve")
GUIDES += ("finite-elements", "cluster", "uncertainty", "design")
EXAMPLES = 8
LOADED = {"script": "src", "img": "src", "link": "href", "source": "src", "iframe": "src"}


class Page(HTMLParser):
    """What a page links to, what it loads, and the places in it that can be linked to."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.loads: set[str] = set()
        self.places: set[str] = {"", "top"}
        self.text = file.read_text(encoding="utf-8")
        self.feed(self.text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note the attributes that name something."""
        named = {name: value for name, value in attrs if value}
        self.places |= {named[key] for key in ("id", "name") if key in named}
        if tag == "a" and "href" in named:
            self.links.add(named["href"])
        if LOADED.get(tag) in named and named.get("rel") not in ("canonical", "next", "prev"):
            self.loads.add(named[LOADED[tag]])


def pages_of(site: Path) -> dict[Path, Page]:
    """Return the pages of a site by their files."""
    return {
        file: Page(file) for file in sorted(site.rglob("*.html")) if "_static" not in file.parts
    }


def faults_of_links(site: Path, pages: dict[Path, Page]) -> list[str]:
    """Return what leads nowhere or out of the site."""
    faults = []
    for file, page in pages.items():
        where = file.relative_to(site)
        for link in sorted(page.links | page.loads):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                if link in page.loads and parts.scheme != "data":
                    faults.append(f"{where} loads {link}")
                continue
            target = target_of(file, parts.path)
            if not target.exists():
                faults.append(f"{where} names {link}, which is not there")
            elif target in pages and unquote(parts.fragment) not in pages[target].places:
                faults.append(f"{where} names {link}, and no such place is on that page")
    for style in sorted(site.rglob("*.css")):
        text = style.read_text(encoding="utf-8")
        if "url(http" in text or "@import url(//" in text or 'url("http' in text:
            faults.append(f"{style.relative_to(site)} loads from elsewhere")
    return faults


def target_of(file: Path, path: str) -> Path:
    """Return the file to which a link of a page leads."""
    target = (file.parent / unquote(path)).resolve() if path else file
    return target / "index.html" if target.is_dir() else target


def linked(file: Path, pages: dict[Path, Page]) -> set[Path]:
    """Return the pages to which a page links."""
    targets = {target_of(file, urlsplit(link).path) for link in pages[file].links if link}
    return targets & set(pages)


def faults_of_content(site: Path, pages: dict[Path, Page]) -> list[str]:
    """Return what the site should hold and does not."""
    front = site / "index.html"
    near = linked(front, pages)
    near |= {there for page in near for there in linked(page, pages)}
    faults = [f"guides/{name} is not two clicks from the front page" for name in GUIDES
              if site / "guides" / f"{name}.html" not in near]  # fmt: skip
    for name in GUIDES:
        if 'class="output' not in pages[site / "guides" / f"{name}.html"].text:
            faults.append(f"guides/{name} shows no output")
    for name in capslip.__all__:
        page = pages.get(site / "api" / f"capslip.{name}.html")
        if page is None or "Examples" not in page.text:
            faults.append(f"capslip.{name} has no page, or no example on it")
    if "--unit" not in pages[site / "warnings.html"].text:
        faults.append("warnings: options have lost their hyphens")
    examples = list((site / "gallery").glob("plot_*.html"))
    if len(examples) < EXAMPLES:
        faults.append(f"the gallery has {len(examples)} examples; expected {EXAMPLES}")
    faults += [f"{file.name} has no picture" for file in examples
               if not any("images/sphx_glr" in load for load in pages[file].loads)]  # fmt: skip
    return faults


if __name__ == "__main__":
    folder = Path(sys.argv[1]).resolve()
    found = pages_of(folder)
    wrong = faults_of_links(folder, found) + faults_of_content(folder, found)
    links = sum(len(page.links) for page in found.values())
    print("\n".join(wrong) or f"{len(found)} pages, {links} links: all there")
    sys.exit(bool(wrong))
