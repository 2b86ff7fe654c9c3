"""Write docs/first-screen.png: first screen of the report on the sample case, as Chromium shows it."""

from __future__ import annotations

import io
import os
import shutil
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from armgap import Arm, diagnose
from armgap.cli.demo import CASE_FOLDER
from armgap.report import write_html

#: Width and height of the browser window [px]; the height fits the three answers and both charts.
SIZE = (1180, 780)
#: Number of colours in the image's palette: the file is a quarter as large as in full colour, without visible difference.
COLOURS = 128
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
TARGET = Path(__file__).resolve().parents[1] / "docs" / "first-screen.png"


def main() -> None:
    """Diagnose the sample case, and save the image of its report when all charts are drawn."""
    result = diagnose(
        CASE_FOLDER / "train-1.parquet", Arm.read(CASE_FOLDER / "arm.toml"), holdout=CASE_FOLDER / "holdout-1.parquet"
    )
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        report = Path(folder) / "report.html"
        write_html(result, report)
        options = ["--no-sandbox"] if os.geteuid() == 0 else []
        browser = playwright.chromium.launch(executable_path=program, args=options)
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]}, color_scheme="light")
        page.goto(report.as_uri())
        page.wait_for_function(
            "() => Bokeh.documents.length > 0 && Bokeh.documents.every((d) => d.is_idle)", timeout=120_000
        )
        picture = page.screenshot()
        browser.close()
    Image.open(io.BytesIO(picture)).convert("RGB").quantize(COLOURS).save(TARGET, optimize=True)


if __name__ == "__main__":
    main()
