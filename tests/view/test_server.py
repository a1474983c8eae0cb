"""The running command: pages, what is refused, and how it ends; in Chromium, a click, keys and layers."""

from __future__ import annotations

import asyncio
import hashlib
import re
import signal
import socket
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from urllib.error import HTTPError
from urllib.parse import quote, urlsplit
from urllib.request import Request, urlopen

import pytest

try:
    import bokeh  # noqa: F401
    import datashader  # noqa: F401
except ModuleNotFoundError:
    pytest.skip("the extra view is not installed", allow_module_level=True)

from bevameter import TerrainDatabase, framework
from bevameter.framework.cli.main import app
from devtools import CHROMIUM, Browser
from old_schema import TO_FIRST
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect
from typer.testing import CliRunner

COMMAND = [sys.executable, "-P", "-m", "bevameter.framework.cli.main", "view"]


@dataclass
class Running:
    """The command, and where its pages are."""

    process: subprocess.Popen
    url: str

    def page(self, path: str = "", host: str | None = None, site: str = "quarry") -> str:
        request = Request(f"{self.url}{path}?site={quote(site)}")
        if host is not None:
            request.add_header("Host", host)
        with urlopen(request) as answer:
            return answer.read().decode()


def start(path: Path, *options: str) -> Running:
    process = subprocess.Popen(
        [*COMMAND, str(path), "--no-browser", "--port", "0", *options],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    said = process.stdout.readline()
    found = re.search(r"http://localhost:\d+/", said)
    assert found is not None, said + process.stdout.read()
    return Running(process, found[0])


@pytest.fixture(scope="module")
def running(path, tmp_path_factory) -> Iterator[Running]:
    """The command on the database; in the end Ctrl-C, and the file is as it was."""
    before = hashlib.sha256(path.read_bytes()).digest()
    running = start(path, "--recordings", str(tmp_path_factory.mktemp("recordings")))
    yield running
    running.process.send_signal(signal.SIGINT)
    said, _ = running.process.communicate(timeout=30)
    assert (running.process.returncode, said) == (0, "")
    assert hashlib.sha256(path.read_bytes()).digest() == before
    assert sorted(each.name for each in path.parent.iterdir()) == [path.name], "no log is left"


def text_of(page: str) -> str:
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", page.split("<body>")[-1])))


def test_classes_tighten_drive_by_drive(running):
    text = text_of(running.page("classes"))
    assert "asphalt Soil unknown: no soil data for class asphalt. Drive slowly on it with wheel sensors." in text
    steps = re.findall(r"(drive \d) 2026-03-0\d 09:00:00 UTC (\d) ([\d.]+) ± ([\d.]+)", text)
    assert [step[:2] for step in steps] == [("drive 1", "1"), ("drive 2", "3")]
    assert float(steps[1][3]) < float(steps[0][3]), "the mean of three stretches is known better"


def test_drives_say_what_was_measured_when_and_why_not(running):
    text = text_of(running.page("drives"))
    assert "10.0 to 18.0 s sand 99 % not measured not measured in the rut" in text
    assert "0.80 (" in text or "0.8 (" in text
    assert "camera: too <dark> not recognised 1" in text
    assert "camera abcdef01" in text
    assert "drive 4" not in text, "it was elsewhere"
    assert "beach &lt;1&gt;" in running.page("drives", site="beach <1>")
    assert "drive 4" in running.page("drives", site="beach <1>")


def test_without_an_explanation_the_page_says_the_command(running):
    assert "bevameter explain RECORDING --db" in running.page("physics")


def test_nothing_comes_from_elsewhere_and_nobody_else_is_answered(running):
    page = running.page()
    sources = re.findall(r"(?:src|href)=[\"']([^\"']+)", page)
    assert any("bokeh" in each for each in sources)
    assert not any(urlsplit(each).netloc for each in sources)
    port = urlsplit(running.url).port
    for path, host, code in (
        ("drives", f"evil.example:{port}", 403), ("frame", None, 400), ("frame?recording=no&t=1&x=", None, 404),
        ("frame?recording=no&t=x&x=", None, 400), ("nothing", None, 404),
    ):  # fmt: skip
        with pytest.raises(HTTPError) as refused:
            running.page(path, host=host)
        assert refused.value.code == code
    with pytest.raises(HTTPError) as refused:
        running.page("drives", site="nowhere")
    assert refused.value.code == 404
    request = HTTPRequest(f"{running.url.replace('http', 'ws')}ws", headers={"Origin": "http://evil.example"})
    with pytest.raises(HTTPClientError, match="403"):
        asyncio.run(opened(request))


def test_all_addresses_are_served_with_a_warning_and_still_under_known_names_only(path):
    running = start(path, "--address", "0.0.0.0")
    try:
        warning = running.process.stdout.readline()
        assert warning.startswith("warning: the page is not protected: anybody who reaches port ")
        assert "ssh -L" in warning
        port = urlsplit(running.url).port
        assert "<html" in running.page("drives", host=f"{socket.gethostname()}:{port}")
        with pytest.raises(HTTPError) as refused:
            running.page("drives", host=f"evil.example:{port}")
        assert refused.value.code == 403
    finally:
        running.process.send_signal(signal.SIGINT)
        running.process.communicate(timeout=30)


@pytest.mark.parametrize("address", ["192.0.2.1", "no.such.host.invalid"])
def test_an_address_of_another_machine_is_refused(path, address):
    result = CliRunner().invoke(app, ["view", str(path), "--no-browser", "--port", "0", "--address", address])
    assert result.exit_code == 2
    assert result.stderr.startswith(f"bevameter: --address: {address}: ")
    assert "an address of this machine" in result.stderr


async def opened(request: HTTPRequest) -> None:
    await websocket_connect(request, subprotocols=["bokeh", "no token"])


@pytest.fixture
def browser(tmp_path) -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    browser = Browser(tmp_path)
    yield browser
    browser.close()


READY = 'document.body?.dataset.ready == "yes"'
IN_VIEW = """(() => {
  const map = Bokeh.documents[0].get_model_by_name("area"), view = Bokeh.index.find_one(map);
  const box = view.el.getBoundingClientRect(), frame = view.frame;
  return [box.left + frame.x_scale.compute(X), box.top + frame.y_scale.compute(Y)];
})()"""


def shown(browser: Browser, part: str = "details") -> str:
    return browser.js(f"document.getElementById('{part}').innerText")


@pytest.mark.end_to_end
def test_in_a_browser(running, browser):
    browser.open(running.url + "?site=quarry", READY)
    assert "sand" in shown(browser, "legend")
    assert "seen, unknown" in shown(browser, "legend")
    assert "No cell selected" in shown(browser)

    browser.wait("Bokeh.documents[0].get_model_by_name('area').inner_width > 100")
    x, y = browser.js(IN_VIEW.replace("X", "1.2").replace("Y", "0.7"))
    browser.click(x, y)
    browser.wait("document.getElementById('details').innerText.includes('Cell at x = 1.25 m, y = 0.75 m')")
    assert "Sand, 100.0 % probable. It bears at least" in shown(browser)
    assert "drive 2, 2026-03-03 09:00:00 UTC" in shown(browser, "observations")
    assert "no recording that could be read in" in shown(browser, "observations")
    regions = "Bokeh.documents[0].get_model_by_name('regions').visible"
    browser.wait(regions)

    for key, cell in (("ArrowUp", "y = 1.25"), ("ArrowUp", "y = 1.75"), ("ArrowRight", "x = 1.75")):
        browser.press(key)
        browser.wait(f"document.getElementById('details').innerText.includes('{cell} m')")
    assert "Soil unknown: no soil data for class asphalt" in shown(browser)
    browser.wait(f"!{regions}")

    choice = "Bokeh.index.find_one(Bokeh.documents[0].get_model_by_name('controls').children[0]).input_el"
    browser.js(
        f"{choice}.focus(); {choice}.value = 'shear strength, lower bound'; {choice}.dispatchEvent(new Event('change'))"
    )
    browser.wait("document.getElementById('legend').innerText.includes('kPa normal stress, lower bound at 95 %')")
    assert "40 cells, 11 of them unknown" in shown(browser, "legend")

    browser.js("document.querySelector('header a').focus()")
    for _ in range(20):
        if browser.js("document.activeElement.id") == "area":
            break
        browser.press("Tab", "\t")
    assert browser.js("document.activeElement.id") == "area", "the map can be reached without a mouse"
    assert not [each for each in browser.requested if not each.startswith((running.url, "data:", "blob:"))]
    assert not browser.errors


def test_bad_input_is_one_line(path, tmp_path, monkeypatch):
    def said(*arguments: str) -> str:
        result = CliRunner().invoke(app, ["view", "--no-browser", *arguments])
        assert result.exit_code == 2
        assert result.stderr.count("\n") == 1
        return result.stderr

    assert "no such file" in said(str(tmp_path / "none.db"))
    assert not list(tmp_path.iterdir())
    assert "no site 'moon'" in said(str(path), "--site", "moon")
    assert "no such folder" in said(str(path), "--recordings", str(tmp_path / "none"))
    monkeypatch.setattr(framework, "view", framework.view)  # put back afterwards: importing it anew replaces it
    monkeypatch.setitem(sys.modules, "bevameter.framework.view.start", None)
    monkeypatch.delitem(sys.modules, "bevameter.framework.view.start")
    monkeypatch.setitem(sys.modules, "bokeh", None)
    for name in [name for name in sys.modules if name.startswith(("bokeh.", "bevameter.framework.view"))]:
        monkeypatch.delitem(sys.modules, name)
    assert 'pip install "bevameter[view]"' in said(str(path))


def test_a_taken_port_and_an_older_schema_are_refused(running, path, tmp_path):
    port = str(urlsplit(running.url).port)
    result = CliRunner().invoke(app, ["view", str(path), "--no-browser", "--port", port])
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert f"{port} is taken" in result.stderr
    old = tmp_path / "old.db"
    with TerrainDatabase(old) as database:
        database.make()
    with closing(sqlite3.connect(old)) as connection:
        connection.executescript(TO_FIRST)
    before = old.read_bytes()
    result = CliRunner().invoke(app, ["view", str(old), "--no-browser"])
    assert result.exit_code == 2
    assert "bevameter db migrate" in result.stderr
    assert old.read_bytes() == before
