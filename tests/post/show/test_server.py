"""The server of msahl show --watch, over loopback: what it answers, and to whom."""

import http.client
import json
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import urllib.request
from urllib.parse import urlsplit

import pytest

from msahl.post.show import server as server_module
from msahl.post.show.server import PageServer
from tests.support.models import ROOT

DECK = ROOT / "decks" / "basics" / "pendulum_by_angle.xml"


@pytest.fixture
def server():
    served = PageServer()
    served.start()
    yield served
    served.close()


def ask(server, path, method="GET", host=None):
    """Status and content of the answer to a request."""
    connection = http.client.HTTPConnection(server.hosts[0], timeout=10)
    headers = {"Host": host} if host else {}
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, content


def test_the_page_and_its_version(server):
    server.replace("<p>one</p>")
    path = urlsplit(server.address).path
    assert ask(server, path) == (200, b"<p>one</p>")
    assert json.loads(ask(server, f"{path}version")[1]) == {"version": 1}
    assert json.loads(ask(server, f"{path}version?after=0")[1]) == {"version": 1}


def test_a_question_waits_for_a_change(server):
    server.replace("one")
    path = urlsplit(server.address).path
    threading.Timer(0.2, server.replace, ["two"]).start()
    assert json.loads(ask(server, f"{path}version?after=1")[1]) == {"version": 2}
    assert ask(server, path) == (200, b"two")


def test_without_a_change_it_is_answered_all_the_same(server, monkeypatch):
    monkeypatch.setattr(server_module, "PATIENCE", 0.05)
    server.replace("one")
    path = urlsplit(server.address).path
    assert json.loads(ask(server, f"{path}version?after=1")[1]) == {"version": 1}


def test_nothing_else_is_served(server):
    server.replace("one")
    path = urlsplit(server.address).path
    for other in ("/", "/version", f"{path}../../etc/passwd", f"{path}deck.xml", "/x/", path[:-2]):
        assert ask(server, other)[0] == 404
    for method in ("POST", "PUT", "DELETE", "HEAD"):
        assert ask(server, path, method)[0] == 501
    # A page of another address may be made to ask under its own name.
    assert ask(server, path, host="evil.example")[0] == 404
    assert ask(server, path, host=server.hosts[1])[0] == 200


@pytest.mark.parametrize("target", ["http://[", "//[::1", "/%zz/", "*", "http://a:b/", "/\xff"])
def test_an_address_that_is_none_is_answered(server, capfd, target):
    with socket.create_connection(server.hosts[0].split(":")) as client:
        request = f"GET {target} HTTP/1.0\r\nHost: {server.hosts[0]}\r\n\r\n"
        client.sendall(request.encode("latin-1"))
        assert client.makefile("rb").readline().split()[1] == b"404"
    assert capfd.readouterr().err == ""


def test_a_tab_that_is_closed_is_no_fault(server, capfd):
    """The answer of several megabytes does not fit into the buffers of a connection."""
    server.replace("x" * 2**23)
    path = urlsplit(server.address).path
    for target in (path, f"{path}version?after=1"):
        client = socket.create_connection(server.hosts[0].split(":"))
        client.sendall(f"GET {target} HTTP/1.0\r\nHost: {server.hosts[0]}\r\n\r\n".encode())
        # Closing with 0 s to linger resets the connection, as a browser does that is ended.
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        time.sleep(0.1)
        client.close()
    server.replace("two")
    assert ask(server, path) == (200, b"two")
    assert capfd.readouterr().err == ""


@pytest.fixture
def shown(tmp_path):
    """A deck, and the program that shows it: its process and the address it printed."""
    deck = tmp_path / "deck.xml"
    deck.write_text(DECK.read_text())
    code = "import sys; from msahl.cli.main import main; main(sys.argv[1:])"
    process = subprocess.Popen(
        [sys.executable, "-c", code, "show", str(deck), "--watch"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    yield deck, process, process.stdout.readline().strip()
    process.kill()
    process.communicate()


def read(address):
    with urllib.request.urlopen(address, timeout=15) as answer:
        return answer.read().decode()


@pytest.mark.slow
def test_the_command_follows_the_deck_until_it_is_interrupted(shown):
    deck, process, address = shown
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]+/", address)
    page = read(address)
    assert "connect-src 'self'" in page
    assert '"version":1' in page
    text = deck.read_text()
    deck.write_text(text.replace("</bodies>", "<oops/></bodies>"))
    assert json.loads(read(f"{address}version?after=1"))["version"] == 2
    assert "unknown element" in read(address)
    deck.unlink()  # as an editor does that replaces the file
    version = json.loads(read(f"{address}version?after=2"))["version"]
    deck.write_text(text)
    assert json.loads(read(f"{address}version?after={version}"))["version"] == version + 1
    assert '"faults":[]' in read(address)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=10)
    assert process.returncode == 0
    assert "good" in said


def test_the_page_is_loaded_again_where_it_was(browser, shown):
    deck, process, address = shown
    context = browser.new_context(viewport={"width": 1200, "height": 700})
    page = context.new_page()
    page.goto(address)
    page.wait_for_selector("[data-state=ready]")
    page.locator(".tree li .what").first.click()
    page.wait_for_selector(".tree li.selected")
    name = page.locator(".tree li.selected .what").inner_text()
    with page.expect_navigation():
        deck.write_text(deck.read_text().replace("<title>", "<title>Again: ", 1))
    assert page.title().startswith("Again: ")
    page.wait_for_selector("[data-state=ready]")
    page.wait_for_selector(f".tree li.selected .what[title='{name}']")
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=10)
    page.wait_for_selector(".ended")
    context.close()
