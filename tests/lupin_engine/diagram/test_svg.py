"""Pictures to look at: SVG that this package draws itself, and PNG with the bundled typeface."""

from __future__ import annotations

import builtins
import struct
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import pytest
from fontTools.ttLib import TTFont

import lupin_engine.diagram
from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.png import png
from lupin_engine.diagram.svg import svg
from lupin_engine.diagram.text_metrics import text_width
from lupin_engine.errors import LupinError
from lupin_engine.missions.folders import default_missions_folder, mission_files
from tests.lupin_engine.diagram import pictured

FONTS = Path(lupin_engine.diagram.__file__).parent / "fonts"
SVG = "{http://www.w3.org/2000/svg}"


def drawn(name: str, **limits: Any) -> ElementTree.Element:
    """The SVG of a chart, read."""
    return ElementTree.fromstring(svg(outline(pictured.chart(name), **limits)))


def texts(root: ElementTree.Element) -> list[str]:
    """All text of a picture."""
    return [element.text or "" for element in root.iter(f"{SVG}text")]


@pytest.mark.parametrize("name", pictured.NAMES)
def test_everything_is_drawn_and_can_be_found(name: str) -> None:
    """Programs find states and transitions; people find the words."""
    given = pictured.chart(name)
    picture, root = outline(given), drawn(name)
    assert sorted(e.attrib["data-state"] for e in root.iter() if "data-state" in e.attrib) == sorted(
        box.name for box in picture.every()
    )
    ids = [id for e in root.iter() for id in e.get("data-transition", "").split()]
    lines = (line.label for box in picture.every() for line in box.lines)
    labels = [label for arrow in picture.arrows for label in arrow.labels]
    labels += filter(None, (*lines, *(note.label for note in picture.notes)))
    assert sorted(ids) == sorted(id for label in labels for id in label.ids)
    shown = texts(root)
    assert all(box.title in shown for box in picture.every())
    together = " ".join(shown)
    assert all(label.event in together for arrow in picture.arrows for label in arrow.labels)


@pytest.mark.parametrize("depth", [1, 2, 3])
@pytest.mark.parametrize("name", pictured.NAMES)
def test_every_depth_is_drawn(name: str, depth: int) -> None:
    """What is collapsed is a box, whatever is inside: a parallel state then has no regions to separate."""
    shown = {e.attrib["data-state"] for e in drawn(name, depth=depth).iter() if "data-state" in e.attrib}
    assert shown == {box.name for box in outline(pictured.chart(name), depth=depth).every()}


@pytest.mark.parametrize("name", pictured.NAMES)
def test_no_text_leaves_the_picture(name: str) -> None:
    """Every text says how wide it is to be, and has that room."""
    root = drawn(name)
    right = float(root.attrib["width"])
    group = next(e for e in root if e.get("transform"))
    offset = float(group.attrib["transform"].partition("(")[2].split()[0])
    for text in group.iter(f"{SVG}text"):
        assert offset + float(text.attrib["x"]) + float(text.attrib["textLength"]) <= right


def test_the_background_is_painted() -> None:
    """A dark page behind the picture does not make it unreadable."""
    root = drawn("inspection")
    first = root.find(f"{SVG}rect")
    assert first is not None
    assert first.attrib == {"width": root.get("width"), "height": root.get("height"), "fill": "#ffffff"}


def test_a_picture_needs_nothing_from_elsewhere() -> None:
    """No style sheet, no font, no script, no link: documentation sites show it as it is."""
    text = svg(outline(pictured.chart("words")))
    assert "href" not in text
    assert "url(" not in text
    assert "<script" not in text
    assert "<style" not in text


def test_the_legend_names_the_colours_that_there_are() -> None:
    """And no others."""
    assert texts(drawn("inspection"))[-5:] == ["done, event", "error", "request", "time", "no event"]
    assert texts(drawn("regions"))[-3:] == ["done, event", "error", "time"]


def test_a_large_chart_is_drawn_in_time() -> None:
    """Of two hundred states; the shipped ones take a tenth of that."""
    from tests.lupin_engine.machine.charts import chart

    ways = {"on": {"next": "B", "operator.skip_current": "C"}, "on_error": "C"}
    inner: dict[str, Any] = {"A": dict(ways), "B": {"on": {"back": "A"}}, "C": {"kind": "final"}}
    states = {f"S{i}": {"states": dict(inner), "on_done": f"S{(i + 1) % 50}"} for i in range(50)}
    root = ElementTree.fromstring(svg(outline(chart(states))))
    assert len([e for e in root.iter() if "data-state" in e.attrib]) == 200


# -- type and pixels --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("weight", "bold"), [("Regular", False), ("SemiBold", True)])
def test_texts_are_as_wide_as_in_the_bundled_typeface(weight: str, bold: bool) -> None:
    """The widths are written down; the typeface has them, too. None of its signs is wider than assumed."""
    font = TTFont(FONTS / f"Inter-{weight}.otf")
    advances, unit = font["hmtx"], font["head"].unitsPerEm
    for code, glyph in font.getBestCmap().items():
        width = advances[glyph][0] / unit
        found = text_width(chr(code), 1.0, bold)
        assert width <= found + 0.0006 if code > 126 else found == pytest.approx(width, abs=0.0006)


@pytest.mark.parametrize("file", mission_files(default_missions_folder()), ids=lambda path: path.stem)
def test_the_typeface_has_every_sign_of_the_shipped_missions(file: Path) -> None:
    """A sign that it lacks would be an empty box."""
    known = set(TTFont(FONTS / "Inter-Regular.otf").getBestCmap())
    used = {char for text in texts(drawn(file.stem)) for char in text}
    assert not {char for char in used if ord(char) not in known}


def test_a_png_has_the_size_of_the_picture_and_text_in_it(tmp_path: Path) -> None:
    """Painted with the bundled typeface alone: without it, the same picture is another one."""
    text = svg(outline(pictured.chart("inspection"), focus="SCANNING"))
    found = png(text)
    assert found[:8] == b"\x89PNG\r\n\x1a\n"
    root = ElementTree.fromstring(text)
    assert struct.unpack(">II", found[16:24]) == (int(root.attrib["width"]), int(root.attrib["height"]))
    assert png(text) == found
    empty = png(text.replace(">READING<", "><"))
    assert empty != found


def test_without_its_package_png_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing package is a sentence, not a traceback."""
    original = builtins.__import__

    def missing(name: str, *rest: Any, **more: Any) -> Any:
        if name == "resvg_py":
            raise ImportError(name)
        return original(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(LupinError) as caught:
        png("<svg/>")
    assert str(caught.value) == (
        "PNG needs a package that is not installed: pip install 'lupin-engine[diagram]'; SVG needs none"
    )
