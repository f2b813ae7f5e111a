"""A page in a real browser: headless Chromium, WebGL2 in software, no network."""

import json
import re
import shutil
import subprocess

import numpy as np
import pytest

# The shell alone opens windows narrower than 500 points
CHROMIUM = shutil.which("chromium-headless-shell")
FLAGS = (
    *("--no-sandbox", "--hide-scrollbars", "--disable-gpu-sandbox"),
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--disable-extensions", "--no-first-run", "--host-resolver-rules=MAP * ~NOTFOUND"),
    "--virtual-time-budget=6000",
)
CATCH = """<script>window.faults = [];
addEventListener("error", (e) => faults.push(String(e.message)));
console.error = console.warn = (...words) => faults.push(words.join(" "));</script>"""
ASK = """<script>addEventListener("load", () => setTimeout(() => {
let found;
try { found = (() => { %s })(); } catch (error) { faults.push(String(error)); }
const told = { found, faults,
  loaded: performance.getEntriesByType("resource").map((one) => one.name) };
%s
}, 300));</script>"""
SAY = """const said = document.createElement("script");
said.type = "text/plain"; said.id = "said"; said.textContent = JSON.stringify(told);
document.body.append(said);"""
TELL = 'parent.postMessage(told, "*");'
EACH = """<!DOCTYPE html><html><body style="margin: 0"><script>
const frames = FRAMES, answers = [], frame = document.createElement("iframe");
frame.style.cssText = "border: 0; height: 900px";
const next = () => {
  const [page, width] = frames[answers.length];
  frame.style.width = width + "px"; frame.src = page;
};
addEventListener("message", (one) => {
  const told = answers.push(one.data);
  if (told < frames.length) { next(); return; }
  frame.remove();
  const said = document.createElement("script");
  said.type = "text/plain"; said.id = "said"; said.textContent = JSON.stringify(answers);
  document.body.append(said);
});
document.body.append(frame); next();
</script></body></html>"""
LONGER = "--virtual-time-budget=30000"
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="chromium-headless-shell is not here")


def _run(folder, flags, page):
    done = subprocess.run(
        [CHROMIUM, *FLAGS, f"--user-data-dir={folder / 'profile'}", *flags, page.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return done.stdout


def ask(page, script, folder, size=(1400, 900), flags=()):
    """Run the body of a function in a page; return what it returns. A fault in the page fails."""
    copy = folder / "asked.html"
    copy.write_text(_asking(page, script), "utf-8")
    size = f"--window-size={size[0]},{size[1]}"
    return _answer(_said(_run(folder, (size, "--dump-dom", *flags), copy)))


def ask_each(page, scripts, folder):
    """Return what each of several scripts finds, by its name: each in a page of its own.

    Their frames are 1400 points wide, or as wide as is given beside a script. They are loaded one
    after the other by one browser, which takes a second to start.
    """
    given = {name: (of, 1400) if isinstance(of, str) else of for name, of in scripts.items()}
    frames = []
    for i, (script, width) in enumerate(given.values()):
        part = folder / f"asked_{i}.html"
        part.write_text(_asking(page, script, TELL), "utf-8")
        frames.append([part.as_uri(), width])
    copy = folder / "asked.html"
    copy.write_text(EACH.replace("FRAMES", json.dumps(frames)), "utf-8")
    found = _said(_run(folder, ("--window-size=1400,900", "--dump-dom", LONGER), copy))
    assert len(found) == len(given), "a page did not get as far as its answer"
    return dict(zip(given, map(_answer, found), strict=True))


def together(scripts):
    """Return one script of several that run one after the other in one page, by their names."""
    each = ", ".join(
        f"{json.dumps(str(name))}: (() => {{ {one} }})()" for name, one in scripts.items()
    )
    return f"return {{ {each} }}"


def _asking(page, script, tell=SAY):
    text = page.read_text("utf-8").replace("<head>", "<head>" + CATCH, 1)
    return text.replace("</body>", ASK % (script, tell) + "</body>", 1)


def _said(dom):
    said = re.search(r'<script type="text/plain" id="said">(.*?)</script>', dom, re.DOTALL)
    assert said, "the page did not get as far as its answer"
    return json.loads(said[1].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&"))


def _answer(said):
    assert said["faults"] == []
    assert said["loaded"] == []  # nothing from elsewhere
    return said.get("found")


def picture(page, folder, script="", size=(1400, 900), flags=()):
    """Return a screenshot as an array of shape (y, x, 3), 0 to 255."""
    from PIL import Image

    copy, png = folder / "seen.html", folder / "seen.png"
    text = page.read_text("utf-8")
    run = f'<script>addEventListener("load", () => {{ {script} }});</script>'
    copy.write_text(text.replace("</body>", run + "</body>", 1), "utf-8")
    _run(folder, (f"--window-size={size[0]},{size[1]}", f"--screenshot={png}", *flags), copy)
    with Image.open(png) as image:
        return np.asarray(image.convert("RGB"), dtype=int)
