"""What mkdocs is given beside the documents: pages from the root, files that pages link to, scripts as files.

The documents are read in the repository and as a site, so their links are those of the repository. A link that leaves
``docs/`` leads to a copy: SECURITY.md and CHANGELOG.md become pages, every other file is put beside the pages as it is.
"""

import hashlib
import html
import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
PAGES = ("SECURITY.md", "CHANGELOG.md")
"""Pages of the root that are pages of the site, too."""
SOURCES = "source"
"""Folder of the site for files of the repository that are no documents."""

_LINK = re.compile(r"(\]\()([^)\s]+)(\))")
_BLOCK = re.compile(
    r"(?P<begin><pre[^>]*>(?:<span></span>)?<code[^>]*>)(?P<text>.*?)(?P<end></code></pre>)", re.DOTALL
)
_EQUATION = re.compile(r"(?P<equation>.*?) {2,}\((?P<number>\d+[a-z]?)\)")
_NUMBER_WIDTH = 7
_INLINE_SCRIPT = re.compile(r"<script>(.*?)</script>", re.DOTALL)

_scripts: dict[str, str] = {}


def slug(text: str, separator: str) -> str:
    """The anchor of a heading, as the repository's own pages make it."""
    return re.sub(r"[^\w\- ]", "", html.unescape(text).lower()).strip().replace(" ", separator)


def site_path(path: str) -> str:
    """Where the site has what is at a path from the repository's root."""
    if path == "README.md":
        return path  # the documents' own front page
    if path in PAGES:
        return path
    return path.removeprefix("docs/") if path.startswith("docs/") else f"{SOURCES}/{path}"


def meant(link: str, page: str) -> str | None:
    """The path from the repository's root that a link of a page means; None for an anchor or an address."""
    path = link.partition("#")[0]
    if not path or re.match(r"[a-z]+:", path):
        return None
    return posixpath.normpath(posixpath.join(posixpath.dirname(page), path))


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Anchors are those that links in the repository go by."""
    config.mdx_configs.setdefault("toc", {})["slugify"] = slug
    _scripts.clear()
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of the root, and every file outside of ``docs/`` that a page links to."""
    texts = {f"docs/{file.src_uri}": file.content_string for file in files.documentation_pages()}
    texts |= {name: (ROOT / name).read_text(encoding="utf-8") for name in PAGES}
    linked = {meant(link, page) for page, text in texts.items() for _, link, _ in _LINK.findall(text)}
    for name in PAGES:
        files.append(File.generated(config, name, content=texts[name]))
    for path in sorted(path for path in linked if path is not None):
        if site_path(path).startswith(f"{SOURCES}/") and (ROOT / path).is_file():
            files.append(File.generated(config, site_path(path), abs_src_path=str(ROOT / path)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links lead to where the site has what they mean in the repository."""
    here = page.file.src_uri
    at = here if here in PAGES else f"docs/{here}"

    def put(match: re.Match[str]) -> str:
        target = meant(match.group(2), at)
        if target is None:
            return match.group(0)
        _, mark, anchor = match.group(2).partition("#")
        moved = posixpath.relpath(site_path(target), posixpath.dirname(here) or ".")
        return f"{match.group(1)}{moved}{mark}{anchor}{match.group(3)}"

    return _LINK.sub(put, markdown)


def on_page_content(content: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Numbered equations of a method's page can be linked to, and stand in a row at its head."""
    if not page.file.src_uri.startswith("methods/"):
        return content
    numbers: list[str] = []

    def line(text: str) -> str:
        """A line of a block: its number is moved to its beginning, where a narrow window shows it, too."""
        found = _EQUATION.fullmatch(text)
        if found is None or found["number"] in numbers:
            return f"{'':{_NUMBER_WIDTH}}{text}" if text.strip() else text
        numbers.append(found["number"])
        shown = f"({found['number']})"
        padding = " " * max(1, _NUMBER_WIDTH - len(shown))
        return f'<span id="equation-{found["number"]}">{shown}</span>{padding}{found["equation"]}'

    def block(match: re.Match[str]) -> str:
        lines = match["text"].split("\n")
        if not any(_EQUATION.fullmatch(one) for one in lines):
            return match[0]
        return match["begin"] + "\n".join(line(one) for one in lines) + match["end"]

    marked = _BLOCK.sub(block, content)
    row = " ".join(f'<a href="#equation-{number}">({number})</a>' for number in numbers)
    return re.sub(r"(</h1>)", rf"\1\n<p>Equations: {row}</p>", marked, count=1) if row else marked


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Scripts inside of pages become files: the service lets no page run one that stands in it."""
    # the dialog is the search, which the theme gives no name
    output = output.replace('role="dialog"', 'role="dialog" aria-label="Search"')
    root = "../" * page.file.url.count("/")

    def put(match: re.Match[str]) -> str:
        text = match.group(1)
        name = f"{hashlib.sha256(text.encode()).hexdigest()[:12]}.js"
        _scripts[name] = text
        return f'<script src="{root}assets/inline/{name}"></script>'

    return _INLINE_SCRIPT.sub(put, output)


def on_post_build(config: MkDocsConfig) -> None:
    """Write the scripts that were taken out of the pages; leave out what only a site with an address needs."""
    site = Path(config.site_dir)
    folder = site / "assets" / "inline"
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in _scripts.items():
        (folder / name).write_text(text, encoding="utf-8")
    for name in ("404.html", "sitemap.xml", "sitemap.xml.gz"):
        (site / name).unlink(missing_ok=True)
    for path in site.rglob("*.map"):  # for the theme's own developers
        path.unlink()
