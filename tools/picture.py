"""Takes the README's picture: ``python -m tools.picture demo/report.html docs/figures/report.png``."""

import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from mock_devices.testing.browser import installed, launch

WIDTH, HEIGHT = 1000, 1130


def main() -> None:
    """Renders the head of the page given first into the file given second."""
    page_file, picture = (Path(argument) for argument in sys.argv[1:3])
    executable = installed() or sys.exit("no Chromium here: `make browser` installs one")
    with sync_playwright() as playwright:
        browser = launch(playwright, executable)
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.goto(page_file.resolve().as_uri())
        page.screenshot(path=picture)
        browser.close()


if __name__ == "__main__":
    main()
