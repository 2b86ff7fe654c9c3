"""Reports in a browser: quiet, offline, drawn, readable at once, on a phone, in the dark and on paper."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

import report_cases as cases
from armgap.diagnosis.comparison import compare
from armgap.report import render_report, words, write_html
from armgap.report.compared import comparison_document

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
DESK, PHONE = (1280, 800), (390, 844)  # px
READABLE = 4.5  # contrast of text, WCAG 2 level AA
PATIENCE_MS = 20_000

IDLE = "() => typeof Bokeh !== 'undefined' && Bokeh.documents.length > 0 && Bokeh.documents.every((d) => d.is_idle)"
PAINTED = """(canvas) => {
  if (canvas.width * canvas.height === 0) return 0;
  const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const seen = new Set();
  for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 0) seen.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
  return seen.size;
}"""
CONTRAST = """(element) => {
  const linear = (c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  const luminance = (text) => {
    const full = text.startsWith("color(srgb") ? 1 : 255;
    const [r, g, b] = text.match(/[0-9.]+/g).map((c) => linear(c / full));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  let ground = element;
  while (getComputedStyle(ground).backgroundColor === "rgba(0, 0, 0, 0)") ground = ground.parentElement;
  const [a, b] = [getComputedStyle(element).color, getComputedStyle(ground).backgroundColor].map(luminance);
  return (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
}"""


@dataclass
class Opened:
    """A page and what it complained about or asked for."""

    page: Any
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    dialogs: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed: pip install 'armgap[browser]'"
    )
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip("no Chromium was found: apt-get install chromium")
    with api.sync_playwright() as playwright:
        unboxed = ["--no-sandbox"] if os.geteuid() == 0 else []
        running = playwright.chromium.launch(executable_path=program, args=unboxed)
        yield running
        running.close()


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Every case and a comparison as pages."""
    folder = tmp_path_factory.mktemp("pages")
    pages = {name: folder / f"{name}.html" for name in (*cases.CASES, "comparison")}
    for name, case in cases.CASES.items():
        write_html(case(), pages[name])
    result = compare(cases.named(), cases.none(), ("worn", cases.HOSTILE))
    pages["comparison"].write_text(render_report(comparison_document(result), {}, "x.html"))
    return pages


@pytest.fixture
def opened(browser, files) -> Iterator[Callable[..., Opened]]:
    contexts = []

    def open_page(name: str, size: tuple[int, int] = DESK, scheme: str = "light", **options: Any) -> Opened:
        context = browser.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, offline=True, **options
        )
        contexts.append(context)
        found = Opened(context.new_page())
        found.page.on("console", lambda m: found.complaints.append(m.text) if m.type in ("error", "warning") else None)
        found.page.on("pageerror", lambda e: found.complaints.append(str(e)))
        found.page.on("request", lambda r: found.requests.append(r.url))
        found.page.on("dialog", lambda d: (found.dialogs.append(d.message), d.dismiss()))
        found.page.goto(files[name].as_uri())
        found.page.wait_for_function(IDLE, timeout=PATIENCE_MS)
        return found

    yield open_page
    for context in contexts:
        context.close()


@pytest.mark.parametrize("name", [*cases.CASES, "comparison"])
def test_a_page_is_quiet_offline_inert_and_drawn(opened, files, name) -> None:
    found = opened(name)
    page = found.page
    page.evaluate("() => window.scrollTo(0, document.body.scrollHeight)")
    assert found.complaints == []
    assert [r for r in found.requests if not r.startswith(("data:", "blob:"))] == [files[name].as_uri()]
    assert found.dialogs == []
    assert cases.HOSTILE in page.inner_text("body")
    charts = page.locator("figure canvas")
    colours = charts.evaluate_all(f"(all) => all.map({PAINTED})")
    figures = page.locator("figure:not(.map)").count()
    assert figures >= (2 if name == "comparison" else 3)
    assert sum(n > 4 for n in colours) >= figures, colours


@pytest.mark.parametrize("name", cases.CASES)
def test_the_first_screen_answers_the_three_questions_with_a_picture(opened, name) -> None:
    page = opened(name).page
    for answer in words.answers(cases.CASES[name]().to_dict()):
        for text in (answer.question, answer.headline):
            box = page.get_by_text(text, exact=True).first.bounding_box()
            assert box["y"] + box["height"] <= DESK[1], text
    for picture in ("section.first figure:not(.map)", "section.first .map"):
        box = page.locator(picture).bounding_box()
        assert box["y"] + box["height"] <= DESK[1], picture


@pytest.mark.parametrize("name", [*cases.CASES, "comparison"])
def test_a_phone_never_scrolls_sideways_and_shows_the_headlines_at_once(opened, name) -> None:
    page = opened(name, PHONE, is_mobile=True, has_touch=True).page
    assert page.evaluate("() => document.documentElement.scrollWidth") == PHONE[0]
    for question in page.locator(".answer h2").all():
        box = question.bounding_box()
        assert box["y"] + box["height"] <= PHONE[1]
    active = "() => Bokeh.documents.flatMap((d) => [...d.all_models]).filter((m) => m.type === 'BoxZoomTool' && m.active).length"
    assert page.evaluate(active) == 0, "a finger on a chart must scroll the page"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_are_readable_in_light_and_dark(opened, scheme) -> None:
    page = opened("effect", scheme=scheme).page
    for place in (
        ".lead",
        ".answer h2",
        ".headline",
        ".answer p >> nth=1",
        "figcaption >> nth=0",
        "th >> nth=-1",
        "nav a >> nth=0",
    ):
        assert page.locator(place).first.evaluate(CONTRAST) >= READABLE, place
    tiles = page.locator(".heat td").evaluate_all(f"(all) => all.map({CONTRAST})")
    assert min(tiles) >= READABLE
    ink = page.evaluate("() => getComputedStyle(document.documentElement).getPropertyValue('--ink').trim()")
    legends = "() => Bokeh.documents.flatMap((d) => [...d.all_models]).filter((m) => m.type === 'Legend').map((m) => m.label_text_color)"
    assert set(page.evaluate(legends)) == {ink}


def test_light_turns_to_dark_while_the_page_is_open(opened) -> None:
    page = opened("effect").page
    legends = (
        "() => Bokeh.documents.flatMap((d) => [...d.all_models]).find((m) => m.type === 'Legend').label_text_color"
    )
    before = page.evaluate(legends)
    page.emulate_media(color_scheme="dark")
    page.wait_for_function(f"(old) => ({legends})() !== old", arg=before, timeout=PATIENCE_MS)


def test_position_and_error_zoom_together(opened) -> None:
    page = opened("effect").page
    section = page.locator("section", has=page.get_by_role("heading", name="Predicted against measured"))
    chart = section.locator("figure").first
    chart.scroll_into_view_if_needed()
    box = chart.locator("canvas").first.bounding_box()
    spans = "() => Bokeh.documents.flatMap((d) => [...d.all_models]).filter((m) => m.type === 'DataRange1d' && m.end - m.start < 3).length"
    narrow = page.evaluate(spans)
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.4 * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], y, steps=5)
    page.mouse.up()
    page.wait_for_function(f"(n) => ({spans})() === n + 1", arg=narrow, timeout=PATIENCE_MS)


def test_paper_takes_drawings_on_white_and_the_screen_its_charts_back(opened) -> None:
    page = opened("effect", scheme="dark").page
    ink = "() => getComputedStyle(document.documentElement).getPropertyValue('--ink').trim()"
    dark, charts = page.evaluate(ink), page.locator("figure [data-root-id]").count()
    page.evaluate("() => dispatchEvent(new Event('beforeprint'))")
    drawings = page.locator("figure > svg.drawing")
    assert drawings.count() == charts
    light = page.evaluate(ink)
    assert light != dark
    assert light in drawings.first.inner_html(), "axes are drawn in the ink of paper"
    page.evaluate("() => dispatchEvent(new Event('afterprint'))")
    assert drawings.count() == 0
    assert page.evaluate(ink) == dark


def test_paper_takes_every_section(opened) -> None:
    page = opened("effect", scheme="dark").page
    page.emulate_media(media="print", color_scheme="dark")
    ground = page.evaluate("() => getComputedStyle(document.body).backgroundColor")
    assert ground == "rgb(255, 255, 255)", "paper is white"
    paper = page.pdf(format="A4", print_background=True)
    assert paper.startswith(b"%PDF")
    assert paper.count(b"/Type /Page\n") >= 3
