"""The texts of the page: in one file, each of them used, and none beside it."""

import re
from html.parser import HTMLParser
from importlib import resources
from pathlib import Path

import pytest

from miurafab.studio import entrance
from miurafab.studio.core import PARTS
from miurafab.studio.texts import texts, with_texts
from miurafab.workflow.page import SCENE

PAGE = resources.files("miurafab.studio").joinpath("page")
SCRIPTS = [
    name
    for name in (*PARTS, "enter.js")
    if name.endswith(".js") and name not in ("texts.js", *SCENE)
]
PAGES = ("studio.html", "enter.html")
KNOWN = {f"{group}.{name}" for group, words in texts().items() for name in words}
NAMES = {"miurafab", "studio", "miurafab studio", "$$", ""}


class Reader(HTMLParser):
    """What a person reads of a page: its text, and the attributes that are read out."""

    def __init__(self):
        super().__init__()
        self.read = []

    def handle_starttag(self, tag, attrs):
        said = ("aria-label", "alt", "title", "placeholder")
        self.read += [value or "" for name, value in attrs if name in said]

    def handle_data(self, data):
        self.read.append(data)


@pytest.mark.parametrize("name", PAGES)
def test_a_page_has_no_text_of_its_own(name):
    reader = Reader()
    reader.feed(PAGE.joinpath(name).read_text(encoding="utf-8"))
    left = [re.sub(r"@[a-z_]+\.[a-z_]+@", " ", text) for text in reader.read]
    left = [re.sub(r"[^\w$]+", " ", text).strip() for text in left]
    assert [text for text in left if text not in NAMES] == []


@pytest.mark.parametrize("name", SCRIPTS)
def test_the_scripts_have_no_sentence_of_their_own(name):
    script = PAGE.joinpath(name).read_text(encoding="utf-8")
    assert sentences(script) == []


def sentences(script):
    code = re.sub(r"(?<!:)//[^\n]*|/\*[\s\S]*?\*/", "", script)
    return re.findall(r"[\"'`][A-Z][a-z]+ [a-z][^\"'`]*[\"'`]", code)


def test_a_sentence_in_a_script_is_found():
    assert sentences('/* "Not this" */ fault("It is wrong."); // "Nor this"') == ['"It is wrong."']


def test_each_text_is_used_and_each_mark_is_known():
    pages = "".join(PAGE.joinpath(name).read_text(encoding="utf-8") for name in PAGES)
    scripts = "".join(PAGE.joinpath(name).read_text(encoding="utf-8") for name in SCRIPTS)
    marks = set(re.findall(r"@([a-z_]+\.[a-z_]+)@", pages))
    groups = "|".join(texts())
    used = {f"{g}.{n}" for g, n in re.findall(rf"\b({groups})\.([a-z_]+)\b", scripts)}
    server = Path(entrance.__file__).read_text(encoding="utf-8")
    used |= {f"{g}.{n}" for g, n in re.findall(r'texts\(\)\["([a-z_]+)"\]\["([a-z_]+)"\]', server)}
    assert marks <= KNOWN
    assert KNOWN - marks - used == set()


def test_a_text_can_be_put_into_html_and_holds_only_small_tags():
    for words in texts().values():
        for text in words.values():
            assert text == text.strip() != ""
            assert re.findall(r"&|<(?!/?(?:b|code|kbd|small)[> ])", text) == []
    with pytest.raises(KeyError):
        with_texts("@shape.nothing@")
