"""Who is let in: nobody from another site, without the key, or with a body without end."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from studios import GUARD, KEY, ORIGIN, PORT, Asked, request, sentence

from miurafab.studio.guard import BODIES, BODY_BYTES, FILE_LIMIT, ORDER_LIMIT, BodyRoom
from miurafab.studio.names import safe_stem, suffix_of


def refused(method, path, **headers):
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    return GUARD.refuse(method, path, given)


def test_the_page_itself_is_let_in():
    for host in (f"127.0.0.1:{PORT}", f"localhost:{PORT}", f"LocalHost:{PORT}"):
        assert refused("GET", f"/{KEY}/", host=host) is None
        assert refused("HEAD", f"/{KEY}/state?x=1", host=host) is None


@pytest.mark.parametrize(
    "host",
    ["", "127.0.0.1", "evil.example", f"evil.example:{PORT}", f"127.0.0.1.evil.example:{PORT}",
     f"127.0.0.1:{PORT + 1}", f"0.0.0.0:{PORT}", f"[::1]:{PORT}", f"127.0.0.1:{PORT}@evil.example"],
)  # fmt: skip
def test_another_name_for_this_server_is_refused(host):
    """A site that has its own name point to 127.0.0.1 is sent away, whatever else it knows."""
    for method in ("GET", "POST"):
        assert sentence(refused(method, f"/{KEY}/", host=host), 421)


def test_no_other_site_reads_and_nobody_opens_a_websocket():
    host = f"127.0.0.1:{PORT}"
    for origin in ("null", "https://evil.example", f"{ORIGIN}.evil.example", ""):
        assert sentence(refused("GET", f"/{KEY}/machine", host=host, origin=origin), 403)
    assert refused("GET", f"/{KEY}/machine", host=host, origin=ORIGIN) is None
    for origin in ({}, {"origin": ORIGIN}):
        assert sentence(refused("GET", f"/{KEY}/", host=host, upgrade="websocket", **origin), 400)
    cross = {"host": host, "upgrade": "websocket", "origin": "https://evil.example"}
    assert sentence(refused("GET", f"/{KEY}/machine", **cross), 403)


@pytest.mark.parametrize(
    "path",
    ["/", "", "*", "/state", f"/{KEY}", f"/{KEY[:-1]}/", f"/{KEY}k/", f"//{KEY}/", f"/x/{KEY}/",
     f"http://127.0.0.1:{PORT}/{KEY}/", f"/?{KEY}/", f"/\udcff{KEY}/", "/ключ/"],
)  # fmt: skip
def test_without_the_key_there_is_nothing(path):
    assert sentence(refused("GET", path, host=f"127.0.0.1:{PORT}"), 404)


@pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS", "PATCH", "CONNECT", "get", ""])
def test_other_methods_are_refused(method):
    assert sentence(refused(method, f"/{KEY}/", host=f"127.0.0.1:{PORT}"), 405)


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"origin": ""}, 403),
        ({"origin": "null"}, 403),
        ({"origin": "https://evil.example"}, 403),
        ({"origin": f"https://127.0.0.1:{PORT}"}, 403),
        ({"origin": f"{ORIGIN}.evil.example"}, 403),
        ({"x_studio_key": ""}, 403),
        ({"x_studio_key": KEY[:-1]}, 403),
        ({"x_studio_key": KEY.upper()}, 403),
        ({"x_studio_key": "\xff"}, 403),
        ({"content_length": ""}, 411),
        ({"content_length": "-1"}, 411),
        ({"content_length": "0x10"}, 411),
        ({"content_length": "²"}, 411),
        ({"transfer_encoding": "chunked"}, 411),
        ({"content_length": str(ORDER_LIMIT + 1)}, 413),
        ({"content_length": "9" * 5000}, 413),
    ],
)
def test_a_post_needs_all_of_it(tmp_path, change, status):
    """And what is refused changes nothing."""
    asked = Asked(tmp_path)
    good = {"target": {"surface": "plane"}}
    sentence(asked.post("fit", good, **change), status)
    assert not asked.orders
    assert asked.post("fit", good).status == 200
    assert len(asked.orders) == 1


def test_only_a_file_may_be_large():
    length = {"content_length": str(FILE_LIMIT)}
    for route, status in (("upload", None), ("fit", 413), ("upload/x", 413)):
        found = GUARD.refuse("POST", f"/{KEY}/{route}", request("POST", route, **length).headers)
        assert (found and found.status) == status
    large = request("POST", "upload", content_length=str(FILE_LIMIT + 1))
    assert GUARD.refuse("POST", large.path, large.headers).status == 413


def test_what_is_being_sent_has_a_bound_in_number_and_bytes():
    room = BodyRoom()
    with contextlib.ExitStack() as under_way:
        for _ in range(BODIES):
            assert under_way.enter_context(room.kept(300))
        with room.kept(300) as there, room.kept(len(b"{}")) as abort:
            assert (there, abort) == (False, True)
    with room.kept(FILE_LIMIT) as one, room.kept(FILE_LIMIT) as two, room.kept(300) as three:
        assert (one, two, three) == (True, True, False)
        with room.kept(len(b"{}")) as abort:
            assert abort
    with room.kept(BODY_BYTES) as there:  # all is free again
        assert there


@given(st.text(), st.text(), st.dictionaries(st.sampled_from(["host", "origin"]), st.text()))
def test_nothing_at_random_gets_in(method, path, headers):
    assert 400 <= GUARD.refuse(method, path, headers).status < 500
    headers["host"] = f"127.0.0.1:{PORT}"
    assert 400 <= GUARD.refuse(method, path, headers).status < 500


@given(st.text())
def test_any_name_becomes_harmless(name):
    stem = safe_stem(name)
    assert stem.isascii()
    assert stem[0].isalnum()
    assert set(stem) <= set("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-")
    assert len(stem) <= 65
    assert safe_stem(f"{stem}.x") == stem


@pytest.mark.parametrize(
    ("name", "stem", "suffix"),
    [
        ("saddle.stl", "saddle", ".stl"),
        ("../../etc/passwd", "passwd", ""),
        ("C:\\Users\\me\\My Saddle.STL", "My-Saddle", ".stl"),
        ("-rf.obj", "rf", ".obj"),
        ("Sättel.obj", "Sattel", ".obj"),
        ("con.stl", "file-con", ".stl"),
        ("lpt1.old.stl", "file-lpt1.old", ".stl"),
        ("scan.STL.gz", "scan", ".stl.gz"),
        ("scan.gz", "scan", ".gz"),
        ("", "file", ""),
        ("..", "file", "."),
        ("鞍.fold", "file", ".fold"),
    ],
)
def test_names(name, stem, suffix):
    assert (safe_stem(name), suffix_of(name)) == (stem, suffix)
