"""The report's page in a browser: zoom, cursor, several logs, a telephone."""

import pytest
import synthetic
from equipoise_robot.log import read_log
from equipoise_tools import names, report
from equipoise_tools.interactive import on_grid

PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}


@pytest.fixture(scope="module")
def one(known_log, tmp_path_factory):
    out = tmp_path_factory.mktemp("one")
    assert report.main([str(known_log), "--out", str(out)]) == 0
    return out / "report.html"


@pytest.fixture
def opened(browser):
    contexts = []

    def open_page(path, **options):
        context = browser.new_context(**options)
        contexts.append(context)
        page = context.new_page()
        errors, requests = [], []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(f"file://{path}")
        assert errors == []
        assert [url for url in requests if not url.startswith(("file:", "data:"))] == []
        return page

    yield open_page
    for context in contexts:
        context.close()


def range_s(page):
    return page.evaluate("report.range")


def test_all_plots_zoom_together_and_back(opened, one):
    page = opened(one, viewport={"width": 1200, "height": 800})
    assert range_s(page) == pytest.approx([0, 9.995], abs=0.01)
    box = page.locator(".u-over").first.bounding_box()
    y = box["y"] + 50
    page.mouse.move(box["x"] + 0.4 * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], y, steps=4)
    page.mouse.up()
    assert range_s(page) == pytest.approx([4, 6], abs=0.1)
    every = page.evaluate("report.plots.map((p) => [p.scales.x.min, p.scales.x.max])")
    assert len(every) >= 8 and all(zoomed == every[0] for zoomed in every)
    page.mouse.dblclick(box["x"] + 100, y)
    assert range_s(page) == pytest.approx([0, 9.995], abs=0.01)


def test_the_cursor_reads_what_the_log_holds(opened, one, known_log):
    page = opened(one, viewport={"width": 1200, "height": 800})
    log = read_log(known_log)
    tick = 1000
    shown = page.evaluate(f"report.plots[0].data.map((column) => column[{tick}])")
    truth, estimate, reference = (
        57.29577951308232 * log[channel]["theta_rad"][tick, 0]
        for channel in (names.TRUTH, names.STATE, names.REFERENCE)
    )
    assert shown[0] == pytest.approx(5.0, abs=0.003)
    assert shown[1:] == pytest.approx([truth, estimate, reference], rel=1e-5, abs=1e-6)
    box = page.locator(".u-over").first.bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 50)
    values = page.locator(".u-legend .u-value").all_inner_texts()
    assert float(values[0]) == pytest.approx(5.0, abs=0.05)
    assert float(values[1]) == pytest.approx(truth, abs=0.05)
    cursors = page.evaluate("report.plots.map((p) => p.cursor.idx)")
    assert len(set(cursors)) == 1  # common to all plots


def test_fits_a_telephone_and_takes_two_fingers(opened, one):
    page = opened(one, **PHONE)
    assert page.evaluate("document.scrollingElement.scrollWidth <= innerWidth")
    page.locator(".u-over").first.scroll_into_view_if_needed()
    page.evaluate("""() => {
          const over = document.querySelector(".u-over"), box = over.getBoundingClientRect();
          const say = (type, pointerId, share) => over.dispatchEvent(new PointerEvent(type, {
            pointerType: "touch", pointerId, bubbles: true, clientY: box.top + 20,
            clientX: box.left + share * box.width}));
          say("pointerdown", 1, 0.4); say("pointerdown", 2, 0.6);
          say("pointermove", 1, 0.2); say("pointermove", 2, 0.8);
          say("pointerup", 1, 0.2); say("pointerup", 2, 0.8);
        }""")
    low, high = range_s(page)
    assert high - low == pytest.approx(9.995 / 3, rel=0.02)
    assert (low + high) / 2 == pytest.approx(5.0, abs=0.1)


def test_compares_several_logs(opened, tmp_path, known_log):
    other = synthetic.write_log(tmp_path / "other.lcm", disarmed_at_s=7.0)
    assert report.main([str(known_log), str(other), "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out/report.png").exists() and (tmp_path / "out/report-2.png").exists()
    page = opened(tmp_path / "out/report.html", viewport={"width": 1200, "height": 800})
    text = page.locator("body").inner_text()
    assert "motors went off at 7.00 s: imu stale" in text and "known.lcm" in text
    labels = page.evaluate("report.plots.map((p) => p.series.slice(1).map((s) => s.label))")
    assert all(label == ["known.lcm", "other.lcm"] for label in labels) and len(labels) >= 6


def test_a_name_in_a_log_cannot_end_the_script(opened, tmp_path, monkeypatch):
    monkeypatch.setattr(report, "picture_of", lambda run: b"")
    (tmp_path / "a<").mkdir()
    evil = synthetic.write_log(tmp_path / "a<" / "script>.lcm", duration_s=6)  # a</script>.lcm
    assert report.main([str(evil), str(evil), "--out", str(tmp_path / "out")]) == 0
    page = opened(tmp_path / "out/report.html")
    assert page.evaluate("report.plots.length") >= 6


def test_long_runs_keep_their_extremes():
    import numpy as np

    t_s = 0.005 * np.arange(100_000)  # two points of the grid share 200 of them
    values = np.zeros(t_s.size)
    values[54_321], values[54_350] = 7.0, -7.0
    values[54_330:54_340] = np.nan
    values[60_000:60_400] = np.inf
    shown = on_grid(np.linspace(0, t_s[-1], 1000), t_s, values)
    hole = ~np.isfinite(shown)
    assert shown.size == 1000 and np.nanmax(shown) == 7.0 and np.nanmin(shown) == -7.0
    assert np.isnan(shown[hole]).all() and 2 <= hole.sum() <= 4


def test_without_uplot_the_picture_is_shown(known_log, tmp_path, capsys, monkeypatch):
    from equipoise_tools import interactive

    monkeypatch.setattr(report, "picture_of", lambda run: b"")
    for module in (interactive, report):
        monkeypatch.setattr(module, "UPLOT", tmp_path / "none")
    assert report.main([str(known_log), "--out", str(tmp_path)]) == 0
    assert "uPlot is not installed" in capsys.readouterr().out
    text = (tmp_path / "report.html").read_text()
    assert "<details>" not in text and "data:image/png" in text
