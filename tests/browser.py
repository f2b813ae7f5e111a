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
const said = document.createElement("script");
said.type = "text/plain"; said.id = "said";
said.textContent = JSON.stringify({ found, faults,
  loaded: performance.getEntriesByType("resource").map((one) => one.name) });
document.body.append(said);
}, 300));</script>"""
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
    text = page.read_text("utf-8")
    text = text.replace("<head>", "<head>" + CATCH, 1)
    text = text.replace("</body>", ASK % script + "</body>", 1)
    copy = folder / "asked.html"
    copy.write_text(text, "utf-8")
    size = f"--window-size={size[0]},{size[1]}"
    dom = _run(folder, (size, "--dump-dom", *flags), copy)
    said = re.search(r'<script type="text/plain" id="said">(.*?)</script>', dom, re.DOTALL)
    assert said, "the page did not get as far as its answer"
    answer = json.loads(said[1].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&"))
    assert answer["faults"] == []
    assert answer["loaded"] == []  # nothing from elsewhere
    return answer.get("found")


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
