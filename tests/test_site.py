"""The pages of the site: the command line takes their commands, and no name is missing."""

import re
import shlex
import sys
from pathlib import Path

import click
import pytest

import capslip
from capslip.cli import main

PROJECT = Path(__file__).parents[1]
DOCS = PROJECT / "docs"
sys.path.insert(0, str(DOCS / "_ext"))
from shown import FENCED, PAGES, commands_in_text, to_run  # noqa: E402

GUIDES = {"vendor-file", "csv", "mated-faces", "measured-curve"}
GUIDES |= {"finite-elements", "cluster", "uncertainty", "design"}


def commands(text):
    """Yield the words of every command of a page."""
    found = commands_in_text(text)
    found += [line for _, body in FENCED.findall(text) for line in shell_lines(body)]
    for command in found:
        words = shlex.split(command, comments=True)
        yield [word for word in words[1:] if word != "..."]


def shell_lines(body):
    joined = re.sub(r"\\\n\s*", " ", body).split("\n")
    return [re.split(r" [|>&] ?", line)[0] for line in joined if line.startswith("capslip ")]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_every_command_of_a_page_is_one_that_the_command_line_takes(page):
    for words in commands(page.read_text(encoding="utf-8")):
        if not words or words[0].startswith("-") or words[0].isupper():
            continue
        command = main.commands[words[0]]
        if any("RESULT" in word or word.endswith("...") for word in words):
            words = [word for word in words if not word.endswith("...")]
        with click.Context(command) as context:
            options, _, _ = command.make_parser(context).parse_args(list(words[1:]))
        overrides = [one for one in options.get("overrides", ()) or () if "=" in one]
        if overrides:
            capslip.load_settings(overrides=tuple(overrides))


def test_what_stands_in_a_text_runs_once_and_what_is_only_named_does_not(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "`capslip batch` and `capslip formats`, `capslip formats`, `capslip bench -o b`\n\n"
        "    capslip analyze face.x3p \\\n        --preload 5 ...\n\n"
        "    capslip batch scans/ --scheduler tcp://head:1\n\n"
        "```{run}\ncapslip --version\n```\n"
    )
    analyze = "capslip analyze face.x3p --preload 5 --no-figures --no-render"
    assert to_run([page]) == [analyze, "capslip formats"]
    assert len(to_run(PAGES)) > 10


def test_there_are_eight_guides_and_the_front_page_has_a_card_for_each():
    assert {path.stem for path in DOCS.glob("guides/*.md")} == GUIDES | {"index"}
    cards = re.findall(r"^:link: guides/(.+)$", (DOCS / "index.md").read_text("utf-8"), re.M)
    assert set(cards) == GUIDES
    assert len(cards) == 8


def test_the_page_of_python_names_every_public_name():
    named = re.findall(r"^   ~capslip\.(\w+)$", (DOCS / "api.md").read_text("utf-8"), re.M)
    assert sorted(named) == sorted(capslip.__all__)


def test_the_page_of_commands_names_every_command():
    text = (DOCS / "commands.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^## capslip (\S+)$", text, re.M)) == set(main.commands)


def test_every_page_is_in_a_table_of_contents():
    listed = set()
    for page in PAGES:
        for body in re.findall(r"```\{toctree\}\n(.*?)```", page.read_text("utf-8"), re.DOTALL):
            folder = page.parent.relative_to(DOCS)
            listed |= {str(folder / line) for line in body.split("\n") if line[:1].isalpha()}
    there = {str(p.relative_to(DOCS).with_suffix("")) for p in PAGES if p.is_relative_to(DOCS)}
    assert there - listed == {"index"}


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ('<a href="nowhere.html">', "nowhere.html, which is not there"),
        ('<a href="other.html#gone">', "no such place"),
        ('<img src="https://example.org/a.png">', "loads https://example.org/a.png"),
        ('<a href="other.html#here">', None),
        ('<a href="https://example.org">', None),
    ],
)
def test_the_check_of_links_finds_what_leads_nowhere(tmp_path, monkeypatch, fault, said):
    monkeypatch.syspath_prepend(str(PROJECT / "tests"))
    check_site = __import__("check_site")
    (tmp_path / "index.html").write_text(fault)
    (tmp_path / "other.html").write_text('<p id="here">')
    faults = check_site.faults_of_links(tmp_path, check_site.pages_of(tmp_path))
    assert (said in faults[0]) if said else not faults
