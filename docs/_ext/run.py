"""A directive that runs what a page shows, and shows what came out.

    ```{run}                    a shell command; `{run} python` for a script
    :exit: 2                    the exit code that it must have, 0 by default
    :folded: How it was made    both parts lie below this title
    :picture: results/x.png     shown below, from what was written
    :keep: verdict answer       only lines of the output that begin with one of these words
    capslip formats
    ```

The blocks of one page run one after the other in one folder, `build/runs/PAGE`, in which
`sample_surfaces` and `configs` lie. Their output is kept until a block, the package or the
way to run it changes. A block that ends with another exit code is a warning, which ends the build.
"""

import hashlib
import inspect
import json
import os
import re
import shutil
import subprocess
import sys
from html import escape
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import Directive, directives
from sphinx.util import logging

from capslip.provenance import code_sha256

PROJECT = Path(__file__).resolve().parents[2]
RUNS = PROJECT / "build" / "runs"
BLOCK = re.compile(r"^```\{run\}.*?^```$", re.MULTILINE | re.DOTALL)
PROGRESS = re.compile(r"^\[ *\d+\.\d s\] .*\n?", re.MULTILINE)  # no two runs have the same seconds
LONGEST_S = 300
LABEL = re.compile(r"[ a-z]{10} (?=\S)")  # of a line of the terminal, or the space below it
log = logging.getLogger(__name__)


class Run(Directive):
    """One block of a page."""

    has_content = True
    optional_arguments = 1
    option_spec = {  # noqa: RUF012
        "exit": directives.nonnegative_int,
        "folded": directives.unchanged,
        "picture": directives.unchanged,
        "keep": directives.unchanged,
    }

    def run(self) -> list[nodes.Node]:
        """Return what was run, and its output."""
        environment = self.state.document.settings.env
        language = self.arguments[0] if self.arguments else "bash"
        source = "\n".join(self.content)
        page = _Page.of(environment)
        output = page.output_of(language, source, self.options.get("exit", 0))
        shown: list[nodes.Node] = [_code(source, language)]
        kept = _kept(output, self.options.get("keep"))
        if kept.strip():
            shown.append(_shown(kept))
        if picture := self.options.get("picture"):
            where = os.path.relpath(page.folder / picture, environment.srcdir)
            shown.append(nodes.image(uri=f"/{where}", alt=Path(picture).stem.replace("_", " ")))
        if title := self.options.get("folded"):
            html = f"<details class='folded'><summary>{title}</summary>"
            return [_html(html), *shown, _html("</details>")]
        return shown


class _Page:
    """The blocks of one page, of which the first look decides whether all run again."""

    def __init__(self, name: str, text: str) -> None:
        self.folder, self.name = RUNS / name, name
        way = (inspect.getsource(_Page), inspect.getsource(_done))
        known = (code_sha256(), *way, *BLOCK.findall(text))
        self.digest = hashlib.sha256("\0".join(known).encode()).hexdigest()
        self.outputs: list[str] = []
        self.file = RUNS / f"{name}.json"
        self.next = 0
        if self.file.exists():
            kept = json.loads(self.file.read_text(encoding="utf-8"))
            self.outputs = kept["outputs"] if kept["digest"] == self.digest else []
        if not self.outputs:
            self._empty()

    @classmethod
    def of(cls, environment) -> "_Page":
        pages = environment.temp_data.setdefault("run_pages", {})
        name = environment.docname
        if name not in pages:
            text = Path(environment.doc2path(name)).read_text(encoding="utf-8")
            pages[name] = cls(name, text)
        return pages[name]

    def output_of(self, language: str, source: str, code: int) -> str:
        """Return what the next block printed; it runs where that is not known."""
        if self.next < len(self.outputs):
            output = self.outputs[self.next]
        else:
            output = self._run(language, source, code)
            self.outputs.append(output)
            kept = {"digest": self.digest, "outputs": self.outputs}
            self.file.write_text(json.dumps(kept, indent=1), encoding="utf-8")
        self.next += 1
        return output

    def _empty(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        for name in ("sample_surfaces", "configs"):
            (self.folder / name).symlink_to(PROJECT / name)

    def _run(self, language: str, source: str, code: int) -> str:
        if language == "bash":
            done = run_shell(source, self.folder)
        else:
            done = _done([sys.executable, "-c", source], self.folder)
        if done.returncode != code:
            log.warning(
                "%s: %r ended with %s; expected %s\n%s",
                *(self.name, source, done.returncode, code, done.stdout),
            )
        return PROGRESS.sub("", done.stdout).replace(str(self.folder), ".")


def run_shell(source: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run shell commands in a folder; the first that fails ends them."""
    return _done(["bash", "-euo", "pipefail", "-c", source], folder, **variables)


def _done(command: list[str], folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    binaries = Path(sys.executable).parent
    environment = {
        "PATH": f"{binaries}:{os.environ['PATH']}",
        "COLUMNS": "100",
        "MPLBACKEND": "Agg",
        "OPENBLAS_NUM_THREADS": "1",
    }
    return subprocess.run(
        command,
        cwd=folder,
        env=os.environ | environment | variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
        text=True,
        timeout=LONGEST_S,
    )


def _kept(output: str, words: str | None) -> str:
    """Return the lines that begin with one of some words, with the lines that go on from them."""
    if words is None:
        return output
    lines: list[str] = []
    keep = False
    for line in output.splitlines():
        if not line.startswith("  "):
            keep = line.split(" ")[0] in words.split()
        if keep:
            lines.append(line)
        elif lines and lines[-1] != "...":
            lines.append("...")
    return "\n".join(lines).removesuffix("...")


def _shown(output: str) -> nodes.raw:
    """Return what was printed; a line that is too long goes on below the text after its label."""
    spans = []
    for line in output.rstrip().splitlines():
        kind = " class=labelled" if LABEL.match(line) else ""
        spans.append(f"<span{kind}>{escape(line, quote=False)}\n</span>")
    return _html(f'<pre class="output">{"".join(spans)}</pre>')


def _code(text: str, language: str) -> nodes.literal_block:
    """Return a block of code."""
    return nodes.literal_block(text, text, language=language)


def _html(text: str) -> nodes.raw:
    return nodes.raw("", text, format="html")


def setup(app) -> dict[str, bool]:
    """Add the directive."""
    app.add_directive("run", Run)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
