"""Requests of those who are not to be let in."""

PORT = 8080
OWN = f"127.0.0.1:{PORT}"

ORIGINS = (
    "null", "", " ", "file://", "about:blank", "data:text/html,x", "http://elsewhere.invalid",
    "https://elsewhere.invalid", f"http://elsewhere.invalid:{PORT}", f"https://127.0.0.1:{PORT}", "http://127.0.0.1",
    f"http://127.0.0.1:{PORT + 1}", f"http://127.0.0.1:{PORT}.elsewhere.invalid", f"http://127.0.0.1:{PORT}/",
    f"http://127.0.0.1:{PORT}@elsewhere.invalid", f"http://elsewhere.invalid@127.0.0.1:{PORT}",
    f"http://localhost:{PORT}", f"http://localhost.elsewhere.invalid:{PORT}", f"http://[::1]:{PORT}",
    f"http://0.0.0.0:{PORT}", f"http://127.0.0.2:{PORT}", f"http://127.0.0.1:{PORT} http://elsewhere.invalid",
    f"HTTP://127.0.0.1:{PORT}", f"chrome-extension://127.0.0.1:{PORT}", f"http://127.1:{PORT}",
)  # fmt: skip
"""Other than that of the page at `OWN`."""

HOSTS = (
    "", "elsewhere.invalid", f"elsewhere.invalid:{PORT}", "127.0.0.1", "localhost", f"127.0.0.1:{PORT + 1}",
    f"127.0.0.1.elsewhere.invalid:{PORT}", f"localhost.elsewhere.invalid:{PORT}", f"127.0.0.2:{PORT}",
    f"0.0.0.0:{PORT}", f"[::1]:{PORT}", f"127.0.0.1:{PORT}@elsewhere.invalid", f"elsewhere.invalid@127.0.0.1:{PORT}",
    f" 127.0.0.1:{PORT}", f"127.0.0.1:0{PORT}", f"127.1:{PORT}", f"2130706433:{PORT}", f"127.0.0.1:{PORT}/secret",
)  # fmt: skip

TOKENS = (
    "/", "", "/?secret", "/?token=secret", "/wrong/", "/secre/", "/secrets/", "/SECRET/", "//secret/", "/./secret/",
    "/x/../secret/", "/%73ecret/", "/secret%2f", "/secret;", "/index.html", "/favicon.ico", "/secr\u00e9t/",
)  # fmt: skip
"""Paths without the token "secret"."""

WAYS_OUT = (
    "", "{out}/there.toml", "{out}/absent.toml", "{out}", "/", "/etc/passwd", "//etc/passwd", "..", "../",
    "../outside/there.toml", "../outside/absent.toml", "below/../../outside/there.toml", "below/../mine.toml",
    "./../outside/there.toml", "..\\outside\\there.toml", "below\\..\\..\\outside", "C:\\Windows\\win.ini",
    "C:mine.toml",
    "\\\\server\\share", "\\etc", "out.toml", "nothing.toml", "door", "door/there.toml", "door/absent.toml",
    "below/chunk", "mine.toml\0", "\0",
)  # fmt: skip
"""Names that a page may not open, in the folder of the test of them."""


def handshake(host, origin):
    """Headers of the handshake of a websocket."""
    return [
        ("Host", host), ("Origin", origin), ("Connection", "Upgrade"), ("Upgrade", "websocket"),
        ("Sec-WebSocket-Version", "13"), ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
    ]  # fmt: skip
