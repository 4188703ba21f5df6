#!/usr/bin/env python3
"""Opens a page in headless Chromium and does what a reader would do.

    browser.py check PAGE          loads, hovers, turns, slides; prints JSON, exits 1 at a fault
    browser.py shot PAGE FOLDER    screenshots at 1280 and 390 pixels, dark and light, and a PDF

Needs Chromium and Python's standard library: the DevTools protocol goes over a pipe.
"""

import atexit
import base64
import contextlib
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

NAMES = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"]
LONGEST_S = 300


class Browser:
    """A headless Chromium that is spoken to through two pipes."""

    def __init__(self):
        program = next(filter(None, map(shutil.which, NAMES)), None)
        if program is None:
            print("no chromium")
            sys.exit(77)
        self.folder = tempfile.mkdtemp()
        to_child, self.out = os.pipe()
        self.into, from_child = os.pipe()
        command = [
            program, "--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe",
            "--disable-dev-shm-usage", "--hide-scrollbars", "--no-first-run",
            "--disable-background-networking", f"--user-data-dir={self.folder}",
        ]
        # Chromium reads from descriptor 3 and writes to 4.
        shell = f'exec "$@" 3<&{to_child} 4>&{from_child}'
        self.process = subprocess.Popen(
            ["bash", "-c", shell, "bash", *command],
            pass_fds=(to_child, from_child),
            start_new_session=True,
            env={**os.environ, "TMPDIR": self.folder},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        atexit.register(self.close)
        signal.signal(signal.SIGALRM, lambda *_: sys.exit(f"not done after {LONGEST_S} s"))
        signal.alarm(LONGEST_S)
        os.close(to_child)
        os.close(from_child)
        self.buffer, self.count, self.session, self.events = b"", 0, None, []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self.session = attached["sessionId"]
        for domain in ["Page", "Runtime", "Log", "Network"]:
            self.call(f"{domain}.enable")

    def read(self):
        while b"\0" not in self.buffer:
            part = os.read(self.into, 1 << 20)
            if not part:
                raise SystemExit("chromium ended")
            self.buffer += part
        message, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(message)

    def call(self, method, **parameters):
        self.count += 1
        message = {"id": self.count, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.out, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.read()
            if answer.get("id") == self.count:
                if "error" in answer:
                    raise SystemExit(f"{method}: {answer['error']}")
                return answer["result"]
            self.events.append(answer)

    def value(self, expression):
        """The value of an expression in the page; a fault in it is an event too."""
        answer = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in answer:
            raise SystemExit(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def open(self, page, width=1280, height=900, dark=False, mobile=False):
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=mobile,
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        still = {"name": "prefers-reduced-motion", "value": "reduce"}
        self.call("Emulation.setEmulatedMedia", features=[scheme, still])
        self.call("Emulation.setTouchEmulationEnabled", enabled=mobile)
        answer = self.call("Page.navigate", url=pathlib.Path(page).resolve().as_uri())
        if "errorText" in answer:
            raise SystemExit(f"{page}: {answer['errorText']}")
        self.value(
            "new Promise((done) => { const look = () => document.readyState === 'complete' &&"
            " location.protocol === 'file:' ? requestAnimationFrame(() => done(true))"
            " : setTimeout(look, 10); look(); })"
        )

    def faults(self):
        """Everything that went wrong since the start: exceptions, console, policy, network."""
        found = []
        for event in self.events:
            method, reported = event.get("method"), event.get("params", {})
            if method == "Runtime.exceptionThrown":
                found.append(reported["exceptionDetails"].get("exception", {}).get("description", "?"))
            elif method == "Runtime.consoleAPICalled" and reported["type"] in ("error", "warning"):
                found.append(str(reported["args"]))
            elif method == "Log.entryAdded" and reported["entry"]["level"] in ("error", "warning"):
                found.append(reported["entry"]["text"])
            elif method == "Network.requestWillBeSent":
                url = reported["request"]["url"]
                if not url.startswith(("file:", "data:", "about:")):
                    found.append(f"asked for {url}")
        return found

    def mouse(self, kind, x, y, down=False):
        button = "left" if down or kind == "mouseReleased" else "none"
        self.call(
            "Input.dispatchMouseEvent", type=kind, x=x, y=y,
            button=button, buttons=1 if down else 0, clickCount=1,
        )

    def key(self, name):
        for kind in ["keyDown", "keyUp"]:
            self.call("Input.dispatchKeyEvent", type=kind, key=name, code=name)

    def middle(self, selector, part=0.5):
        """A place in an element that is scrolled into view; scrolling takes a frame."""
        self.value(
            f"document.querySelector({selector!r})"
            ".scrollIntoView({ block: 'center', behavior: 'instant' })"
        )
        self.settle()
        return self.value(
            f"(() => {{ const e = document.querySelector({selector!r});"
            f" const r = e.getBoundingClientRect(); return [r.left + {part} * r.width,"
            " r.top + 0.5 * r.height]; })()"
        )

    def settle(self):
        self.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def tip(self):
        self.settle()
        return self.value("document.getElementById('tip').hidden ? '' : document.getElementById('tip').textContent")

    def close(self):
        """Ends the browser and removes its profile, into which the last of its processes may
        write for a moment after the first has ended."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        for _ in range(100):
            shutil.rmtree(self.folder, ignore_errors=True)
            if not os.path.exists(self.folder):
                break
            time.sleep(0.05)


def check(page):
    browser, reported = Browser(), {}

    def expect(what, seen):
        reported[what] = seen
        if not seen:
            reported.setdefault("failed", []).append(what)

    for width, mobile in [(1280, False), (390, True)]:
        browser.open(page, width, 844, dark=mobile, mobile=mobile)
        drawn = int(browser.value("document.documentElement.dataset.drawn || -1"))
        places = browser.value("document.querySelectorAll('.draw').length")
        expect(f"{width}: every drawing is drawn", drawn == places)
        filled = browser.value(
            "[...document.querySelectorAll('.draw')].every((e) => e.querySelector('svg path, canvas'))"
        )
        expect(f"{width}: no drawing is empty", filled)
        wide = browser.value("document.documentElement.scrollWidth")
        expect(f"{width}: nothing sticks out sideways", wide <= width)
        painted = browser.value(
            "[...document.querySelectorAll('canvas')].every((c) => { const d = c.getContext('2d')"
            ".getImageData(0, 0, c.width, c.height).data; const seen = new Set();"
            " for (let k = 0; k < d.length; k += 4 * 97) seen.add(d[k] << 16 | d[k + 1] << 8 | d[k + 2]);"
            " return seen.size > 20; })"
        )
        expect(f"{width}: the pictures hold many colours", painted)
    browser.open(page)
    for selector, unit in [("#draw-path svg[role]", "mN"), ("#draw-currents svg[role]", " A"), ("#draw-errors canvas", "mN"), ("#draw-field canvas", "T/m"), ("#draw-turn canvas", "mm"), ("#draw-cost svg[role]", "CPU time: "), ("#draw-stage-0 svg[role]", "CPU time: "), ("#draw-stage-4 svg[role]", "quartiles: "), ("#draw-front-0 svg[role]", "force on the magnet: "), ("#draw-front-2 svg[role]", " ms")]:
        if not browser.value(f"!!document.querySelector({selector!r})"):
            continue
        browser.mouse("mouseMoved", *browser.middle(selector))
        tip = browser.tip()
        expect(f"hover over {selector} tells values with units", unit in tip)
        other = browser.middle(selector, 0.3)
        browser.mouse("mouseMoved", *other)
        expect(f"another place of {selector} tells other values", browser.tip() != tip)
        browser.mouse("mouseMoved", 2, 2)
    if browser.value("!!document.querySelector('#draw-path')"):
        browser.value("document.querySelector('#draw-path svg[role]').focus()")
        browser.settle()
        browser.key("ArrowRight")
        first = browser.tip()
        browser.key("ArrowRight")
        expect("arrow keys read the path", "N/m" in first and browser.tip() not in ("", first))
    for place, word in [("cost", "error: "), ("stage-0", "error: "), ("front-1", "mass: ")]:
        if browser.value(f"!!document.querySelector('#draw-{place}')"):
            browser.value(f"document.querySelector('#draw-{place} svg[role]').focus()")
            browser.settle()
            browser.key("Home")
            first = browser.tip()
            browser.key("ArrowRight")
            expect(f"arrow keys go from point to point of {place}", word in first and browser.tip() not in ("", first))
    if browser.value("!!document.querySelector('#draw-turn')"):
        turns(browser, expect)
    if browser.value("!!document.querySelector('#draw-field')"):
        slides(browser, expect)
    if browser.value("!!document.querySelector('#draw-replay')"):
        watches(browser, expect)
    order = browser.value("[...document.querySelectorAll('h1,h2,h3')].map((h) => Number(h.tagName[1]))")
    steps = all(b <= a + 1 for a, b in zip(order, order[1:]))
    expect("headings go down one level at a time", order[:1] == [1] and steps)
    unnamed = browser.value(
        "[...document.querySelectorAll('[role=img],button,input,select')].filter((e) =>"
        " !(e.getAttribute('aria-label') || e.textContent.trim() || e.closest('label'))).length"
    )
    expect("everything that can be touched has a name", unnamed == 0)
    expect("no fault is logged", not browser.faults())
    reported["faults"] = browser.faults()
    reported["first paint ms"] = browser.value(
        "(performance.getEntriesByName('first-contentful-paint')[0] || {}).startTime"
    )
    print(json.dumps(reported, indent=1))
    sys.exit(1 if "failed" in reported else 0)


def turns(browser, expect):
    def way():
        return browser.value("JSON.stringify(document.querySelector('#draw-turn canvas').dataset)")

    picture = "document.querySelector('#draw-turn canvas').toDataURL().length"
    before, size = way(), browser.value(picture)
    x, y = browser.middle("#draw-turn canvas")
    browser.mouse("mousePressed", x, y, True)
    browser.mouse("mouseMoved", x + 90, y + 20, True)
    browser.mouse("mouseReleased", x + 90, y + 20)
    expect("the mouse turns the surface", way() != before and browser.value(picture) != size)
    before = way()
    browser.mouse("mouseMoved", x, y)
    expect("a mouse without its button does not", way() == before)
    browser.value("document.querySelector('#draw-turn canvas').focus()")
    for key in ["ArrowLeft", "ArrowUp"]:
        before = way()
        browser.key(key)
        expect(f"{key} turns it", way() != before)
    browser.call("Emulation.setTouchEmulationEnabled", enabled=True)
    before = way()
    x, y = browser.middle("#draw-turn canvas")
    for kind, points in [("touchStart", [[x, y]]), ("touchMove", [[x + 40, y]]), ("touchMove", [[x + 70, y]]), ("touchEnd", [])]:
        points = [{"x": a, "y": b} for a, b in points]
        browser.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
    browser.settle()
    expect("a finger turns it", way() != before)
    browser.call("Emulation.setTouchEmulationEnabled", enabled=False)


def slides(browser, expect):
    reported = "document.querySelector('#draw-field output').textContent"
    before = browser.value(reported)
    browser.value("document.querySelector('#draw-field input').focus()")
    browser.key("ArrowRight")
    browser.key("ArrowRight")
    browser.settle()
    expect("the slider changes the height", "mm" in before and browser.value(reported) != before)
    browser.value(
        "(() => { const s = document.querySelector('#draw-field select'); s.value = s.options.length - 1;"
        " s.dispatchEvent(new Event('change')); })()"
    )
    browser.mouse("mouseMoved", *browser.middle("#draw-field canvas"))
    expect("a coil alone is reported per ampere", "mT/m/A" in browser.tip())


def watches(browser, expect):
    moved = "document.querySelector('#draw-replay').innerHTML"
    at = "Number(document.querySelector('#draw-replay input').value)"
    before, said = browser.value(moved), browser.value("document.querySelector('#draw-replay p').textContent")
    browser.value("document.querySelector('#draw-replay input').focus()")
    for _ in range(5):
        browser.key("ArrowRight")
    browser.settle()
    expect("the slider moves the finger", browser.value(at) == 5 and browser.value(moved) != before)
    now = browser.value("document.querySelector('#draw-replay p').textContent")
    expect("the forces of that moment are reported", "mN" in now and now != said)
    click = "document.querySelector('#draw-replay button').click()"
    browser.value(click)
    for _ in range(100):
        browser.settle()
        if browser.value(at) > 5:
            break
    expect("the button plays it", browser.value(at) > 5)
    browser.value(click)
    stopped = browser.value(at)
    browser.settle()
    expect("and stops it", browser.value(at) == stopped)


def shot(page, folder):
    browser, name = Browser(), pathlib.Path(page).resolve().parent.name
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for width in [1280, 390]:
        for dark in [False, True]:
            browser.open(page, width, 900, dark, mobile=width < 500)
            browser.settle()
            image = browser.call("Page.captureScreenshot", captureBeyondViewport=True, format="png")
            path = folder / f"{name}_{width}_{'dark' if dark else 'light'}.png"
            path.write_bytes(base64.b64decode(image["data"]))
    browser.open(page)
    pdf = browser.call("Page.printToPDF", printBackground=False, paperWidth=8.27, paperHeight=11.69)
    (folder / f"{name}.pdf").write_bytes(base64.b64decode(pdf["data"]))
    print(browser.faults())


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[1] == "check":
        check(sys.argv[2])
    elif len(sys.argv) == 4 and sys.argv[1] == "shot":
        shot(sys.argv[2], sys.argv[3])
    else:
        sys.exit(__doc__)
