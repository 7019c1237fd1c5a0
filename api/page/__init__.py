"""The page of the service: TypeScript in `sources`; what is built from it, in `built`, is all that is served."""

from pathlib import Path

BUILT = Path(__file__).parent / "built"
NOT_BUILT = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>tissue-rig: page not built</title>
<body><h1>This page is not built yet</h1>
<p>The service runs, and everything but its page works: see <a href="/api/v1/openapi.json">its interface</a>.</p>
<p>To build the page, run <code>make page</code> in the checkout (it needs the package registries npm and PyPI), then
load this address again. To stop the bench without it, use the hardware stop, or
<code>curl -X POST http://127.0.0.1:{stop_port}/estop</code>.</p></body></html>
"""
