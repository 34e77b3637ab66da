"""The documents at ``/help``: a site that was built beforehand, from a folder, under a policy of its own."""

import asyncio
import os
from pathlib import Path

from fastapi import APIRouter, Request, Response
from starlette.responses import FileResponse, HTMLResponse, RedirectResponse

__all__ = ["HELP", "HELP_POLICY", "help_router"]

HELP = "/help"
"""Where the documents are served."""

HELP_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; font-src 'self'; "
    "connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""As strict as that of the status page, but for icons, which the site's style sheet holds as data: addresses."""

_HEADERS = {"Content-Security-Policy": HELP_POLICY, "Cache-Control": "no-cache"}
_MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".map": "application/json",
    ".svg": "image/svg+xml",
    ".png": "image/png",
}
_TEXT = "text/plain; charset=utf-8"
"""Of every other file: aircraft files, schemas and source that the documents link to."""

_SHELL = """\
<!doctype html>
<html lang="en">
<head>
  <meta charset="utf-8">
  <meta name="viewport" content="width=device-width, initial-scale=1">
  <meta name="color-scheme" content="light dark">
  <title>Help · wingwatch</title>
  <link rel="icon" type="image/svg+xml" href="/pages/icon.svg">
  <link rel="stylesheet" href="/pages/app.css">
</head>
<body>
  <header class="top">
    <a class="brand" href="/"><img src="/pages/icon.svg" alt="" width="24" height="24">wingwatch</a>
  </header>
  <main>{text}</main>
</body>
</html>
"""
_ABSENT = _SHELL.format(
    text="""
    <h1>Help</h1>
    <p class="lead">The documents are not installed with this service.</p>
    <p>In the source, <code>make docs</code> builds them into <code>dist/site</code>; start the service with
    <code>--documents dist/site</code>. The source has them in <code>docs/</code>, to be read as they are.</p>
    <p>In Docker, add <code>-f docker/compose.documents.yaml</code> to <code>docker compose</code> after
    <code>make docs</code>: it mounts <code>dist/site</code>.</p>
    <p><a href="/docs">REST</a> is described here in any case, and <code>wingwatch --help</code> lists the commands.</p>
  """
)
_NO_PAGE = _SHELL.format(
    text="""
    <h1>Help</h1>
    <p class="lead">The documents have no such page. They begin at <a href="/help/index.html">their first page</a>.</p>
  """
)


def help_router(folder: Path | None) -> APIRouter:
    """The documents below ``/help``.

    Args:
        folder: of the built site; None where there is none, which ``/help`` then says (404).
    """
    router = APIRouter(include_in_schema=False)
    site = None if folder is None else folder.resolve()

    @router.get(HELP)
    async def front() -> Response:
        if site is None:
            return HTMLResponse(_ABSENT, 404)
        return RedirectResponse(f"{HELP}/index.html", headers=_HEADERS)

    @router.get(f"{HELP}/{{path:path}}")
    async def page(path: str, request: Request) -> Response:
        if site is None:
            return HTMLResponse(_ABSENT, 404)
        found = await asyncio.to_thread(_file, site, path or "index.html")
        if found is None:
            return HTMLResponse(_NO_PAGE, 404)
        file, facts = found
        media_type = _MEDIA_TYPES.get(file.suffix, _TEXT)
        answer = FileResponse(file, headers=_HEADERS, media_type=media_type, stat_result=facts)
        if request.headers.get("if-none-match") == answer.headers["etag"]:
            return Response(status_code=304, headers={**_HEADERS, "ETag": answer.headers["etag"]})
        return answer

    return router


def _file(site: Path, path: str) -> tuple[Path, os.stat_result] | None:
    """A file of the site and its facts; None for one that is not there or that lies outside of the folder."""
    try:
        found = (site / path).resolve()
        return (found, found.stat()) if found.is_relative_to(site) and found.is_file() else None
    except (OSError, ValueError):  # a name too long, or with a NUL
        return None
