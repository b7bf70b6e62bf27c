"""What MkDocs does for our site beside its own work: a hook, named in mkdocs.yml.

A page that shows `NAME.svg` where only `NAME.yaml` stands, shows that mission: it is drawn while the site is
built, so no picture is older than its mission. So are the pages of the proofs that mkdocs.yml names under
`extra`: `proofs/PAGE.html` is the report of `lupin prove` with those arguments. What is not proven fails the
build. And the one script that the theme would fetch is ours.
"""

from __future__ import annotations

import contextlib
import posixpath
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

sys.path.insert(0, str(Path(__file__).parent))

from pages import ROOT, installed

from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.svg import svg
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.registry import load_catalog

_PICTURE = re.compile(r"!\[[^]]*\]\(([^):]+)\.svg\)")
#: Where the theme gets what makes the search work on files, and where we have it.
_THEIRS, _OURS = "https://unpkg.com/iframe-worker/shim", "assets/iframe-worker.js"
#: Browsers that print a page into a file.
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
#: Drawn with the lifecycle around it, to be seen once.
WHOLE = ("guide/steps/01-first",)
#: A link out of the documentation, into the repository.
_LINK_OUT = re.compile(r"\[([^]]+)\]\(((?:\.\./)+[^)#]+)\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pictures that pages show and nobody has drawn, and the proofs (called by MkDocs)."""
    docs = Path(config.docs_dir)
    wanted: dict[str, Path] = {}
    for page in files.documentation_pages():
        for name in _PICTURE.findall(page.content_string):
            picture = Path(page.src_uri).parent / f"{name}.svg"
            mission = docs / picture.with_suffix(".yaml")
            if files.get_file_from_path(picture.as_posix()) is None and mission.is_file():
                wanted[picture.as_posix()] = mission
    with contextlib.ExitStack() as stack:
        for plugin in sorted(
            {plugin for mission in wanted.values() for plugin in mission.parent.glob("*.py")}
        ):
            stack.enter_context(installed(plugin))
        for uri, mission in wanted.items():
            files.append(File.generated(config, uri, content=draw(mission, uri.removesuffix(".svg"))))
    for name, report in proofs(tuple(config.extra.get("proofs", {}).items())).items():
        files.append(File.generated(config, f"proofs/{name}.html", content=report))
    return files


@cache
def proofs(wanted: tuple[tuple[str, str], ...]) -> Mapping[str, str]:
    """Prove side by side, once for all builds of `mkdocs serve`, and return each page by its name.

    Args:
        wanted: the name of each page, and the arguments of `lupin prove`.

    Raises:
        PluginError: something is broken, or was not proven.
    """
    with tempfile.TemporaryDirectory(prefix="lupin-proofs-") as folder:
        files = {name: Path(folder, f"{name}.html") for name, _ in wanted}
        begun = [_prove([*shlex.split(asked), "--report", str(files[name])]) for name, asked in wanted]
        told = [process.communicate()[0] for process in begun]
        failed = [text for process, text in zip(begun, told, strict=True) if process.returncode]
        if failed:
            raise PluginError("\n".join(("a page is no proof:", *failed)))
        return {name: file.read_text(encoding="utf-8") for name, file in files.items()}


def _prove(arguments: list[str]) -> subprocess.Popen[str]:
    """Begin a proof in a process of its own, in the checkout: the page names files by their paths in it."""
    lupin = [sys.executable, "-m", "lupin_cli.main", "prove"]
    options = ["--quiet", "--no-scenarios", "--jobs", "1"]
    return subprocess.Popen(
        [*lupin, *options, *arguments], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def draw(mission: Path, name: str) -> str:
    """Return a mission's picture."""
    loaded = load_missions([str(mission)], load_catalog())
    focus = None if name in WHOLE else loaded.names[0]
    return svg(outline(loaded.chart, focus=focus))


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Leave only the text of links to files beside the documentation (called by MkDocs).

    The site does not have them, the repository does. A link to what neither has stays, and fails the build.
    """
    docs = Path(config.docs_dir).resolve()
    here = (docs / page.file.src_uri).parent

    def told(link: re.Match[str]) -> str:
        target = (here / link[2]).resolve()
        return f"`{link[1]}`" if target.is_file() and not target.is_relative_to(docs) else link[0]

    return _LINK_OUT.sub(told, markdown)


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Let a page fetch nothing from elsewhere (called by MkDocs)."""
    return output.replace(_THEIRS, posixpath.relpath(_OURS, posixpath.dirname(page.file.dest_uri) or "."))


def on_post_template(output: str, template_name: str, config: MkDocsConfig) -> str:
    """The same for the page that tells of a missing one (called by MkDocs)."""
    return output.replace(_THEIRS, f"/{_OURS}")


def on_post_build(config: MkDocsConfig) -> None:
    """Print the cheat sheet where there is a browser for it (called by MkDocs)."""
    page = Path(config.site_dir, "cheat-sheet.html")
    browser = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if browser is not None and page.is_file():
        printed = f"--print-to-pdf={page.with_suffix('.pdf')}"
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer"]
        # The page is our own, and the print is no more than a convenience: its failure fails nothing.
        with contextlib.suppress(subprocess.TimeoutExpired):
            subprocess.run([browser, *options, printed, page.as_uri()], capture_output=True, timeout=60)
