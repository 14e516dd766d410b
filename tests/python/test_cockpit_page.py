"""The cockpit as a person meets it: drives, faults, restarts, logs and parameters in a browser."""

import math
import os
import shutil
import signal
import subprocess
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from equipoise_robot.log import read_log
from equipoise_tools import names
from equipoise_tools.cockpit import frames
from started_cockpit import PATIENCE_S, Started, until

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("multicast")]


@pytest.fixture(scope="module")
def logs(tmp_path_factory, known_log) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    shutil.copy(known_log, folder / "known.lcm")
    return folder


@pytest.fixture
def page(browser):
    made = browser.new_page(viewport={"width": 1000, "height": 700})
    made.set_default_timeout(1000 * PATIENCE_S)
    errors = []
    made.on("pageerror", lambda error: errors.append(str(error)))
    yield made
    # Shown where a test fails: why it did not arm or drive.
    print(made.inner_text("body"), "focus:", made.evaluate("document.hasFocus()"))
    made.close()
    assert errors == []


# A person in a browser.


def shown(page, expression: str):
    return page.evaluate(expression)


def position(page) -> list[float]:
    return shown(page, "cockpit.newest.EQUIPOISE_STATE.position_W_m")


def asked_speed(page) -> float:
    return shown(page, "Math.hypot(...cockpit.newest.EQUIPOISE_COMMAND.velocity_W_m_s)")


def stays_still(page, doing) -> None:
    """For half a second of the robot's time, whatever is being done."""
    time_s = "cockpit.newest.EQUIPOISE_STATE.utime * 1e-6"
    began_s = shown(page, time_s)

    def over() -> bool:
        doing()
        assert asked_speed(page) == 0
        return shown(page, time_s) >= began_s + 0.5

    until(over, "the robot's time goes on")


def heard(page) -> bool:
    return shown(page, "Boolean(cockpit.newest && cockpit.status.heard && cockpit.status.remote?.status)")


def text(page, selector: str) -> str:
    return page.locator(selector).inner_text()


def take_and_arm(page) -> None:
    page.click("#take")
    page.wait_for_selector("#arm:enabled")
    page.click("#arm")
    page.wait_for_selector("#state[data-state=armed]")
    # The robot's state comes before its answer to the sender: what is pushed between them waits to be let go.
    until(lambda: shown(page, "cockpit.status.remote.status.state") == "armed", "the page may drive")


def test_arms_drives_stops_and_survives_a_restart(page, cockpit):
    page.goto(cockpit.link)
    until(lambda: heard(page), "the page hears the robot")
    assert cockpit.token not in page.url
    # Read-only and disarmed until somebody takes control.
    assert text(page, "#arm-state").lower() == "disarmed"
    assert "no arm request" in text(page, "#reasons")
    assert page.locator("#arm").is_disabled()
    page.keyboard.down("w")
    page.wait_for_timeout(300)
    page.keyboard.up("w")
    assert asked_speed(page) == 0
    take_and_arm(page)
    until(lambda: text(page, "#reasons") == "", "no reason against the motors is shown")
    # Keys.
    page.keyboard.down("w")
    until(lambda: asked_speed(page) > 0.1, "the robot is asked to drive")
    until(lambda: position(page)[0] > 0.05, "the ball rolls forward")
    page.keyboard.press("Space")
    until(lambda: asked_speed(page) == 0, "Stop ends the drive")
    stays_still(page, lambda: page.keyboard.down("w"))  # the key is still down, and repeats
    page.keyboard.up("w")
    # The stick: to the left.
    began = position(page)[1]
    box = page.locator("#stick").bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 5, middle[1], steps=3)
    until(lambda: position(page)[1] > began + 0.03, "the ball rolls to the left")
    page.keyboard.press("Space")
    until(lambda: asked_speed(page) == 0, "Stop ends the drive")
    stays_still(page, lambda: page.mouse.move(box["x"] + 20, middle[1], steps=2))  # still dragged
    page.mouse.up()
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 5, middle[1])
    until(lambda: asked_speed(page) > 0.1, "the stick drives again")
    page.mouse.up()
    until(lambda: asked_speed(page) == 0, "the stick springs back")
    page.click("#disarm")
    page.wait_for_selector("#state[data-state=disarmed]")
    # The firmware dies; its successor is disarmed, and answers the same page.
    os.kill(cockpit.firmware(), signal.SIGKILL)
    until(lambda: "ended" in text(page, "#firmware"), "the page says that the firmware has ended")
    until(lambda: "no telemetry" in text(page, "#arm-state").lower(), "the page shows no stale state")
    starts = shown(page, "cockpit.status.simulated.starts")
    page.click("#restart")
    until(lambda: shown(page, "cockpit.status.simulated.starts") == starts + 1, "it starts anew")
    until(lambda: heard(page), "the page hears the robot again")
    page.wait_for_selector("#state[data-state=disarmed]")
    page.wait_for_selector("#arm:enabled")
    page.click("#arm")
    page.wait_for_selector("#state[data-state=armed]")
    page.focus("#logs")  # where Space and letters are the list's
    page.keyboard.press("Escape")
    page.wait_for_selector("#state[data-state=disarmed]")
    page.click("#restart")  # upright for the next test


def test_a_gamepad_drives_and_disarms(page, cockpit):
    page.add_init_script("""const up = () => ({pressed: false});
        window.pad = {connected: true, id: "pad", axes: [0, 0, 0, 0], buttons: [up(), up()]};
        navigator.getGamepads = () => [null, window.pad];""")
    page.goto(cockpit.link)
    until(lambda: heard(page), "the page hears the robot")
    assert text(page, "#gamepad") == "pad"
    page.evaluate(
        "pad.axes[1] = -1"
    )  # pushed already when the robot is armed: nothing moves before it is let go
    take_and_arm(page)
    stays_still(page, lambda: None)
    page.evaluate("pad.axes[1] = 0")
    page.wait_for_timeout(200)
    page.evaluate("pad.axes[1] = -1")
    until(lambda: asked_speed(page) > 0.1, "the left stick drives")
    page.evaluate("dispatchEvent(new Event('blur'))")
    until(lambda: asked_speed(page) == 0, "who looks elsewhere does not drive")
    stays_still(page, lambda: None)  # the stick is still pushed
    page.evaluate("pad.axes[1] = 0")
    page.wait_for_timeout(200)
    page.evaluate("Object.defineProperty(document, 'hidden', {get: () => window.away, configurable: true})")
    page.evaluate("window.away = true; pad.axes[1] = -1")
    stays_still(page, lambda: None)
    page.evaluate("window.away = false")
    stays_still(page, lambda: None)
    page.evaluate("pad.axes[1] = 0")
    page.wait_for_timeout(200)
    page.evaluate("pad.axes[1] = -1")
    until(lambda: asked_speed(page) > 0.1, "let go and pushed again it drives")
    page.evaluate("pad.axes[1] = 0.05")
    until(lambda: asked_speed(page) == 0, "a stick that is almost centred asks for nothing")
    page.evaluate("pad.axes[1] = -1")
    until(lambda: asked_speed(page) > 0.1, "it drives again")
    page.evaluate("pad.buttons[0].pressed = true")
    until(lambda: asked_speed(page) == 0, "A stops")
    stays_still(page, lambda: page.evaluate("pad.buttons[0].pressed = false"))  # still tilted
    page.evaluate("pad.buttons[1].pressed = true")
    page.wait_for_selector("#state[data-state=disarmed]")
    page.click("#restart")


def test_says_a_fault_in_words(page, root, logs):
    started = Started(root, logs, "--robot", "edumip", "--", "--fault", "adc_open@0")
    try:
        page.goto(started.link)
        until(lambda: heard(page), "the page hears the robot")
        until(lambda: "below safety.min_battery_V" in text(page, "#reasons"), "the fault is named")
        page.click("#take")
        page.wait_for_selector("#arm:enabled")
        page.click("#arm")
        until(lambda: shown(page, "cockpit.status.remote.status.turn") == 1, "the robot was asked")
        until(lambda: shown(page, "cockpit.status.remote.status.state") == "off", "and has not armed")
        assert text(page, "#arm-state").lower() == "disarmed"
        assert "battery low" in text(page, "#events")
    finally:
        started.end()


def test_records_and_plays_back(page, cockpit, logs):
    page.goto(cockpit.link)
    until(lambda: heard(page), "the page hears the robot")
    page.click("#record")
    until(lambda: shown(page, "cockpit.status.recording?.events > 100"), "events are recorded")
    name = shown(page, "cockpit.status.recording.name")
    page.click("#record")
    until(lambda: shown(page, "cockpit.status.recording === null"), "the recording ends")
    assert read_log(logs / name)[names.STATE].size > 5
    page.focus("#logs")
    page.wait_for_selector("#logs option[value='known.lcm']", state="attached")
    page.select_option("#logs", "known.lcm")
    page.wait_for_selector("#player:visible")
    assert page.locator("#arm").is_disabled()
    page.evaluate("s = document.getElementById('slider'); s.value = 6; s.dispatchEvent(new Event('input'))")
    time_s = "cockpit.newest.EQUIPOISE_STATE.utime * 1e-6"
    until(lambda: abs(shown(page, time_s) - 6) < 0.02, "the slider shows that moment")
    until(lambda: shown(page, "cockpit.history") > 100, "and the plots before it")
    page.click("#play")
    until(lambda: shown(page, time_s) > 6.3, "it plays on")
    page.click("#play")
    page.click("#close-log")
    until(lambda: shown(page, "cockpit.newest?.kind") == frames.LIVE, "the live robot is back")


def test_a_log_is_filtered_again_beside_what_was(page, cockpit, root, logs):
    run = [root / "build/host/equipoise", "run", "--backend", "sim", "--config", root / "config/mbbr.toml"]
    run += ["--telemetry", "off", "--speed", "50", "--arm", "--duration-s", "6", "--log", logs / "died.lcm"]
    subprocess.run([*map(str, run), "--fault", "encoder_dead@3"], capture_output=True, check=True)
    page.goto(cockpit.link)
    page.focus("#logs")
    page.wait_for_selector("#logs option[value='died.lcm']", state="attached")
    page.select_option("#logs", "died.lcm")
    page.wait_for_selector("#player:visible")
    page.evaluate("s = document.getElementById('slider'); s.value = 5; s.dispatchEvent(new Event('input'))")
    assert "what if" not in text(page, "#plots")
    page.fill("#changes", "safety.detecton=false")
    page.click("#filter-again")
    until(lambda: "did you mean safety.detection" in text(page, "#message"), "a slip is named")
    page.wait_for_selector("#filter-again:enabled")
    page.fill("#changes", "safety.detection=false")
    page.click("#filter-again")
    page.wait_for_selector("#what-if:visible")
    alarms = page.locator("#what-if tr", has_text="alarms").locator("td").all_inner_texts()
    assert "without wheel" in alarms[1] and "without wheel" not in alarms[2]
    assert "what if" in text(page, "#plots")
    until(lambda: shown(page, "cockpit.newest?.WHAT_IF_STATE?.utime > 4.9e6"), "its curve at that moment")
    page.click("#close-log")
    until(lambda: not page.locator("#what-if").is_visible(), "it goes with the log")
    until(lambda: "what if" not in text(page, "#plots"), "and its curves")


def test_parameters_have_a_range_and_change_in_simulation(page, cockpit):
    page.goto(cockpit.link)
    until(lambda: heard(page), "the page hears the robot")
    page.click("#parameter-details summary")
    page.fill("#filter", "max_tilt_rad")
    row = page.locator("tr[data-key='safety.max_tilt_rad']")
    assert "0.05 to 1.5" in row.inner_text() and "rad" in row.inner_text()
    assert "config/mbbr.toml:" in row.inner_text()
    field = page.locator("input[aria-label='safety.max_tilt_rad']")
    assert not field.is_editable()
    page.click("#take")
    until(field.is_editable, "who is in control may change it")
    starts = shown(page, "cockpit.status.simulated.starts")
    field.fill("7")
    page.click("#apply")
    until(lambda: "max_tilt_rad" in text(page, "#message") and "1.5" in text(page, "#message"), "an error")
    assert shown(page, "cockpit.status.simulated.starts") == starts
    field.fill("0.5")
    page.click("#apply")
    until(lambda: shown(page, "cockpit.status.simulated.starts") == starts + 1, "it starts anew")
    until(lambda: field.get_attribute("value") or field.input_value() == "0.5", "the new value")
    assert shown(page, "cockpit.status.simulated.overrides") == {"safety.max_tilt_rad": "0.5"}


def test_history_is_bounded(page, cockpit):
    page.goto(cockpit.link)
    until(lambda: heard(page), "the page hears the robot")
    kept = page.evaluate("""async () => {
          const { History } = await import('/plots.js');
          const h = new History(2);
          for (let i = 0; i < 100000; i++) h.push([i, -i]);
          const [t] = h.view([0]);
          return [h.length, h.columns[0].length, t[0], t[t.length - 1], h.last()];
        }""")
    assert kept == [3000, 6000, 97000, 99999, 99999]


def test_the_leading_ratio_is_plotted_against_its_bound(page, cockpit):
    page.goto(cockpit.link)
    until(lambda: shown(page, "cockpit.newest?.EQUIPOISE_FAULTS?.bound > 0"), "what the robot weighs comes")
    title, columns = page.evaluate("""async () => {
          const { Plots } = await import('/plots.js');
          const plots = new Plots(document.createElement("div"));
          plots.build("mip");
          const state = (s) => ({ utime: 1e6 * s, theta_rad: [0, 0, 0], phi_dot_rad_s: [0, 0],
            omega_B_rad_s: [0, 0, 0], normalized_innovation: 1 });
          plots.add({ EQUIPOISE_STATE: state(1) }, 1);  // an older robot's
          plots.add({ EQUIPOISE_STATE: state(2),
            EQUIPOISE_FAULTS: { ratio: 21, runner_up_ratio: 3, bound: 18.6 } }, 1);
          const { holder, columns } = plots.plots.at(-1);
          return [holder.textContent, plots.history.view(columns).map((c) => Array.from(c))];
        }""")
    assert title.startswith("Fault hypotheses")
    assert [column[1] for column in columns] == [2, 21, 3, 18.6]
    assert all(math.isnan(column[0]) for column in columns[1:])


def test_another_site_in_the_same_browser_is_kept_out(page, cockpit, tmp_path):
    """A page of another origin, which even knows the token."""
    (tmp_path / "evil.html").write_text("<!doctype html><title>evil</title>")

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    site = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=tmp_path))
    threading.Thread(target=site.serve_forever, daemon=True).start()
    try:
        page.goto(f"http://127.0.0.1:{site.server_port}/evil.html")
        got = page.evaluate(
            """([host, token]) => new Promise((done) => {
              const s = new WebSocket(`ws://${host}/socket`);
              s.onopen = () => s.send(JSON.stringify({do: "hello", token}));
              s.onmessage = ({data}) => done(String(data));
              s.onclose = ({code}) => done(code);
            })""",
            [cockpit.host, cockpit.token],
        )
        assert got == 1006  # refused before it was open
        framed = page.evaluate(
            """(origin) => new Promise((done) => {
              const f = document.createElement("iframe");
              f.src = origin;
              f.onload = () => done(f.contentDocument?.title ?? "hidden");
              document.body.append(f);
            })""",
            cockpit.origin,
        )
        assert framed == "hidden"
    finally:
        site.shutdown()
