"""The page in a real browser: turned, pointed at, searched, exploded, by mouse, finger and key."""

import io
from functools import lru_cache

import numpy as np
import pytest
from browser import browser
from PIL import Image
from report_samples import page_text, sample

SHIFT = 8


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(page_text(), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def tab():
    with browser() as opened:
        yield opened


@pytest.fixture
def desk(tab, report):
    """The page on a desk: a mouse and a keyboard; small, for the picture is made without a GPU."""
    tab.show(1000, 640)
    return ready(tab, report)


@pytest.fixture
def phone(tab, report):
    tab.show(390, 844, touch=True)
    return ready(tab, report)


def ready(tab, report, fragment=""):
    tab.open(report, fragment)
    tab.wait("globalThis.report?.views.assembly.frames")
    return tab


def state(tab):
    return tab.js("report.state")


def at(tab, mark):
    """Where a part is drawn, in CSS pixels."""
    return tab.js(
        "(() => { const v = report.views.assembly; "
        f"const p = v.project(v.index.get({mark!r})); return [p.x, p.y] }})()"
    )


def canvas(tab):
    return tab.middle(".hero canvas")


@lru_cache(maxsize=1)
def front_panel():
    """A panel that nothing hides from the first view: the nearest to the eye."""
    parts = sample().parts
    from phexfab.report.fields import shell_view

    back = shell_view(sample().shell).axes[2]
    return max(parts.panels, key=lambda p: float(p.solid.vertices.mean(0) @ back))


def pixels(tab):
    with Image.open(io.BytesIO(tab.picture())) as image:
        return np.asarray(image.convert("RGB"), float)


def text(tab, selector):
    return tab.js(f"document.querySelector({selector!r}).textContent")


def test_the_page_runs_without_errors_and_asks_for_nothing(desk):
    assert desk.errors == []
    outside = [
        url for url in desk.asked if not url.startswith(("file:", "data:", "blob:", "about:"))
    ]
    assert outside == []
    views = desk.js("Object.keys(report.views)")
    assert sorted(views) == ["assembly", "gauss", "gaussInset", "shell"]


def test_parts_stand_where_the_geometry_says(desk):
    """Centres projected by the page against those of a camera written here, from its state."""
    now, parts = state(desk), sample().parts
    points = np.concatenate([p.solid.vertices for p in (*parts.panels, *parts.beams)])
    drums = [n.cylinder for n in parts.nodes]
    tops = [d.base + d.axis * d.length * s for d in drums for s in (0, 1)]
    assert len(tops)
    box = desk.js(
        "(() => { const b = document.querySelector('.hero canvas').getBoundingClientRect();"
        " return [b.x, b.y, b.width, b.height] })()"
    )
    scene = desk.js("(({middle, radius}) => ({middle, radius}))(report.model.scenes.assembly)")
    assert np.linalg.norm(points - scene["middle"], axis=1).max() <= scene["radius"] * (1 + 1e-9)
    a, e = np.radians([now["azimuth"], now["elevation"]])
    back = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    up = np.cross(back, right)
    eye = np.array(now["target"]) + now["distance"] * back
    for panel in parts.panels[::5]:
        middle = (panel.solid.vertices.mean(0) - scene["middle"]) / scene["radius"]
        ray = middle - eye
        scale = box[3] / 2 / np.tan(np.radians(13)) / -(ray @ back)
        want = [
            box[0] + box[2] / 2 + scale * (ray @ right),
            box[1] + box[3] / 2 - scale * (ray @ up),
        ]
        assert at(desk, panel.mark) == pytest.approx(want, abs=0.5)


def test_the_whole_assembly_is_in_sight_at_first(desk):
    x0, y0, x1, y1 = desk.js(
        "(() => { const b = document.querySelector('.hero canvas').getBoundingClientRect();"
        " return [b.left, b.top, b.right, b.bottom] })()"
    )
    spots = np.array([at(desk, p.mark) for p in sample().parts.panels])
    assert (spots > [x0, y0]).all() and (spots < [x1, y1]).all()
    # Its parts fill the view: nothing is a speck in the middle.
    wide, tall = np.ptp(spots, axis=0)
    assert wide > 0.5 * (x1 - x0) or tall > 0.5 * (y1 - y0)


def test_a_click_tells_all_about_a_part(desk):
    panel = front_panel()
    desk.click(*at(desk, panel.mark))
    assert state(desk)["chosen"] == [panel.mark]
    assert text(desk, "#card h3").startswith(panel.mark)
    card = text(desk, "#card")
    flat = panel.flat
    assert f"{flat.thickness:g}\u202fmm" in card and flat.material.name in card
    assert f"{panel.area / 1e6:.3f}"[:5] in card
    rows = desk.js(
        "[...document.querySelectorAll('#card tbody tr')].map((r) => "
        "[...r.cells].map((c) => c.textContent))"
    )
    lengths = np.linalg.norm(np.roll(flat.outline, -1, 0) - flat.outline, axis=1)
    assert [float(row[1]) for row in rows] == pytest.approx(lengths, abs=0.051)
    # Inner angles of a hexagon, convex or not, sum to 720 degrees.
    angles = [float(row[2].rstrip("°")) for row in rows]
    assert sum(angles) == pytest.approx(180 * (len(rows) - 2), abs=0.06 * len(rows))
    assert [row[-1] for row in rows] == [note.neighbour for note in flat.edges]
    # Its place on the sheet: one part of the small drawing is lit, and it is this one.
    lit = desk.js("[...document.querySelectorAll('#card .place .hot')].map((g) => g.dataset.mark)")
    assert lit == [panel.mark]
    assert desk.js("location.hash") == f"#{panel.mark}"
    # What is chosen is amber in the picture.
    x, y = (round(c) for c in at(desk, panel.mark))
    red, green, blue = pixels(desk)[y, x]
    assert red > 150 and red > green > blue + 40


def test_a_click_on_nothing_lets_go(desk):
    desk.click(*at(desk, front_panel().mark))
    assert state(desk)["chosen"]
    x, y = desk.js(
        "(() => { const b = document.querySelector('.hero canvas').getBoundingClientRect();"
        " return [b.left + 6, b.top + 6] })()"
    )
    desk.click(x, y)
    assert state(desk)["chosen"] == []
    assert text(desk, "#card h3") == "Checks"


def test_neighbours_are_a_click_away(desk):
    panel = front_panel()
    desk.click(*at(desk, panel.mark))
    mark = desk.js("document.querySelector('#card tbody .mark').textContent")
    desk.press("#card tbody .mark")
    assert state(desk)["chosen"] == [mark]
    beam = next(b for b in sample().parts.beams if b.mark == mark)
    said = text(desk, "#card")
    assert all(near in said for near in beam.neighbours) and all(
        node in said for node in beam.nodes
    )


def test_a_failed_check_flies_to_its_worst_part(desk):
    failed = next(c for c in sample().checks if not c.ok and c.worst)
    before = state(desk)
    desk.press("#card .checks button.bad:not(:disabled)")
    after = state(desk)
    assert after["chosen"] == [failed.worst] and after["distance"] < 0.9 * before["distance"]
    x, y = canvas(desk)
    assert at(desk, failed.worst) == pytest.approx((x, y), abs=60)
    assert text(desk, "#card .why.bad").startswith("✕ Panel mass")
    # The row of the table does the same, from anywhere on the page.
    desk.key("Escape")
    assert state(desk)["chosen"] == []
    desk.press("table.checks tr.bad td")
    assert state(desk)["chosen"] == [failed.worst]
    assert desk.js("document.getElementById('stage').getBoundingClientRect().top") < 640


def test_drag_turns_right_drag_moves_wheel_zooms_double_click_returns(desk):
    x, y = canvas(desk)
    first = state(desk)
    desk.drag((x, y), (x + 100, y + 40))
    turned = state(desk)
    assert turned["azimuth"] == pytest.approx(first["azimuth"] - 35, abs=1)
    assert turned["elevation"] == pytest.approx(first["elevation"] + 14, abs=1)
    assert turned["chosen"] == [] and turned["distance"] == first["distance"]
    mark = front_panel().mark
    before = np.array(at(desk, mark))
    desk.drag((x, y), (x + 60, y - 30), button="right")
    moved = np.array(at(desk, mark)) - before
    assert moved == pytest.approx([60, -30], rel=0.35)
    desk.wheel(x, y, -400)
    near = state(desk)
    assert near["distance"] < 0.7 * first["distance"]
    desk.click(x, y, count=2)
    desk.js("new Promise(requestAnimationFrame)")
    back = state(desk)
    for key in ("azimuth", "elevation", "distance"):
        assert back[key] == pytest.approx(first[key])


def test_the_wheel_scrolls_the_page_until_the_view_is_clicked(desk):
    x, y = canvas(desk)
    before = state(desk)
    desk.wheel(x, y, 200)
    desk.wait("scrollY > 0")
    assert state(desk)["distance"] == before["distance"]


def test_the_keyboard_does_everything(desk):
    desk.js("document.querySelector('.hero canvas').focus()")
    first, scrolled = state(desk), desk.js("scrollY")
    desk.key("ArrowRight")
    assert state(desk)["azimuth"] == pytest.approx(first["azimuth"] - 8)
    desk.key("ArrowUp")
    assert state(desk)["elevation"] == pytest.approx(first["elevation"] - 8)
    assert desk.js("scrollY") == scrolled
    desk.key("ArrowLeft", SHIFT)
    assert state(desk)["target"] != first["target"]
    desk.key("+")
    assert state(desk)["distance"] == pytest.approx(first["distance"] / 1.25)
    desk.key("-")
    assert state(desk)["distance"] == pytest.approx(first["distance"])
    desk.key("0")
    assert state(desk)["azimuth"] == first["azimuth"]
    assert state(desk)["target"] == pytest.approx(first["target"])
    desk.key("e")
    assert state(desk)["explode"] == 1
    desk.key("e")
    assert state(desk)["explode"] == 0
    for k in range(len(first["shown"])):
        desk.key(str(k + 1))
        assert state(desk)["shown"][k] is False
        desk.key(str(k + 1))
    assert state(desk)["shown"] == first["shown"]
    desk.key("/")
    assert desk.js("document.activeElement.id") == "find"
    desk.key("Escape")
    desk.key("?")
    assert desk.js("document.getElementById('help').open") is True
    assert "explode" in text(desk, "#help")
    desk.key("Escape")
    assert desk.js("document.getElementById('help').open") is False


def test_a_search_finds_a_mark(desk):
    mark = sample().parts.panels[-1].mark
    desk.press("#find")
    desk.type(mark[:-1].lower())
    offers = desk.js("[...document.querySelectorAll('#found b')].map((b) => b.textContent)")
    assert offers and all(offer.startswith(mark[:-1]) for offer in offers)
    desk.type(mark[-1])
    desk.key("ArrowDown")
    assert desk.js("document.querySelector('#found [aria-selected=true] b').textContent") == mark
    desk.key("Enter")
    assert state(desk)["chosen"] == [mark]
    assert at(desk, mark) == pytest.approx(canvas(desk), abs=60)
    # The view has no room for a node without a hub; one with a hub is found like the rest.
    node = sample().parts.nodes[0].mark
    desk.js("document.getElementById('find').value = ''")
    desk.press("#find")
    desk.type(node)
    desk.key("Enter")
    assert state(desk)["chosen"] == [node] and "hub" in text(desk, "#card h3")


def test_explosion_moves_parts_apart(desk):
    def spread():
        spots = np.array([at(desk, p.mark) for p in sample().parts.panels[:8]])
        size = desk.js("report.views.assembly.perPixel")
        return np.ptp(spots, axis=0).max() * size

    whole = spread()
    desk.js(
        "(() => { const e = document.getElementById('explode'); e.value = 100;"
        " e.dispatchEvent(new Event('input')) })()"
    )
    assert state(desk)["explode"] == 1 and spread() > 1.3 * whole
    x0, y0, x1, y1 = desk.js(
        "(() => { const b = document.querySelector('.hero canvas').getBoundingClientRect();"
        " return [b.left, b.top, b.right, b.bottom] })()"
    )
    spots = np.array([at(desk, p.mark) for p in sample().parts.panels])
    assert (spots > [x0, y0]).all() and (spots < [x1, y1]).all()


def test_layers_are_hidden_in_the_picture_and_from_the_pointer(desk):
    panel = front_panel()
    place = at(desk, panel.mark)
    names = desk.js(
        "[...document.querySelectorAll('#layers label')].map((l) => l.textContent.trim())"
    )
    assert names == ["Panels", "Beams", "Rim beams", "Nodes", "Gauss image"]
    with_panels = pixels(desk)
    desk.press("#layers label:nth-of-type(1) input")
    desk.js("new Promise((f) => requestAnimationFrame(() => requestAnimationFrame(f)))")
    without = pixels(desk)
    assert (np.abs(with_panels - without).max(2) > 20).mean() > 0.05
    desk.click(*place)
    assert panel.mark not in state(desk)["chosen"]
    desk.press("#layers label:last-child input")
    assert desk.js("document.querySelector('.inset').hidden") is True


def test_colours_follow_a_field(desk):
    before = pixels(desk)
    desk.js(
        "(() => { const c = document.getElementById('colour'); c.value = 'Panel area';"
        " c.dispatchEvent(new Event('change')) })()"
    )
    desk.js("new Promise((f) => requestAnimationFrame(() => requestAnimationFrame(f)))")
    assert (np.abs(pixels(desk) - before).max(2) > 20).mean() > 0.05
    assert "m²" in text(desk, "#scale")


def test_a_face_of_the_gauss_image_is_its_panel(desk):
    desk.js("document.querySelector('[data-view=gauss]').scrollIntoView({block: 'center'})")
    mark, x, y = desk.js(
        "(() => { const v = report.views.gauss, { eye } = v.camera(); let best = 0, most = -2;"
        " for (let k = 0; k < report.model.faces.length; k++) { const m = v.middle(k);"
        " const d = (m[0] * eye[0] + m[1] * eye[1] + m[2] * eye[2]) / Math.hypot(...m);"
        " if (d > most) { most = d; best = k } }"
        " const p = v.project(best); return [v.marks[best], p.x, p.y] })()"
    )
    desk.click(x, y)
    assert state(desk)["chosen"] == [mark]


def test_one_finger_turns_two_fingers_move_and_pinch_a_tap_chooses(phone):
    x, y = canvas(phone)
    first = state(phone)
    phone.touch([(x, y)], [(x + 30, y)], [(x + 60, y)])
    turned = state(phone)
    assert turned["azimuth"] == pytest.approx(first["azimuth"] - 21, abs=1)
    assert phone.js("scrollY") == 0
    phone.touch([(x - 30, y), (x + 30, y)], [(x - 45, y), (x + 45, y)], [(x - 60, y), (x + 60, y)])
    near = state(phone)
    assert near["distance"] == pytest.approx(turned["distance"] / 2, rel=0.1)
    assert near["azimuth"] == turned["azimuth"] and near["chosen"] == []
    mark = front_panel().mark
    before = np.array(at(phone, mark))
    phone.touch(
        [(x - 30, y), (x + 30, y)], [(x - 20, y + 10), (x + 40, y + 10)],
        [(x - 10, y + 20), (x + 50, y + 20)],
    )  # fmt: skip
    assert np.array(at(phone, mark)) - before == pytest.approx([20, 20], abs=9)
    phone.js("document.getElementById('fit').click()")
    phone.touch([tuple(at(phone, mark))])
    assert state(phone)["chosen"] == [mark]
    assert mark in text(phone, "#said")


@pytest.mark.parametrize(("width", "height", "touch"), [(1400, 900, False), (390, 844, True)])
@pytest.mark.parametrize("dark", [False, True])
def test_the_page_fits_its_window_by_day_and_night(tab, report, width, height, touch, dark):
    tab.show(width, height, touch=touch, dark=dark)
    ready(tab, report)
    assert tab.js("document.documentElement.scrollWidth") <= width
    picture = pixels(tab)
    assert (picture[:8].mean() < 60) == dark
    # Words stand out against what they stand on (WCAG AA asks for 4.5).
    for selector in ("h1", ".verdict span", "#card h3", "#card .soft", "dl.key dt", "td.note"):
        assert contrast(tab, selector) >= 4.5, selector


def contrast(tab, selector):
    colours = tab.js(
        "(() => { const e = document.querySelector(" + repr(selector) + ");"
        " let g = e; while (getComputedStyle(g).backgroundColor === 'rgba(0, 0, 0, 0)')"
        " g = g.parentElement; return [getComputedStyle(e).color,"
        " getComputedStyle(g).backgroundColor] })()"
    )
    light = []
    for colour in colours:
        rgb = np.array([float(c) for c in colour[colour.index("(") + 1 : -1].split(",")[:3]]) / 255
        linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
        light.append(float(linear @ [0.2126, 0.7152, 0.0722]))
    return (max(light) + 0.05) / (min(light) + 0.05)


def test_all_that_can_be_used_has_a_name_and_shows_its_focus(desk):
    nameless = desk.js(
        "[...document.querySelectorAll('button, input, select, canvas, [role=listbox]')]"
        ".filter((e) =>"
        " !(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length))"
        ".map((e) => e.outerHTML.slice(0, 80))"
    )
    assert nameless == []
    desk.js("document.querySelector('.hero canvas').focus()")
    seen = set()
    for _ in range(8):
        desk.key("Tab")
        seen.add(desk.js("document.activeElement.id || document.activeElement.tagName"))
        style = desk.js("getComputedStyle(document.activeElement).outlineStyle")
        assert style != "none"
    assert {"find", "explode"} <= seen


def test_flights_take_time_unless_the_reader_wants_calm(tab, report):
    mark = sample().parts.panels[0].mark
    for calm in (True, False):
        tab.show(1000, 640, calm=calm)
        ready(tab, report)
        tab.js(f"report.choose(['{mark}'], {{fly: true}})")
        assert state(tab)["flying"] is not calm
        tab.wait("!report.state.flying")
        assert at(tab, mark) == pytest.approx(canvas(tab), abs=60)


def test_an_address_may_name_a_part(tab, report):
    tab.show(1000, 640)
    mark = sample().parts.beams[3].mark
    ready(tab, report, f"#{mark}")
    assert state(tab)["chosen"] == [mark]
    ready(tab, report, "#nonsense")
    assert state(tab)["chosen"] == []


def test_without_a_way_to_decompress_the_pictures_stay(tab, report):
    tab.show(1000, 640)
    made = tab.call(
        "Page.addScriptToEvaluateOnNewDocument", source="delete window.DecompressionStream"
    )
    try:
        tab.open(report)
        tab.wait("document.querySelector('.old:not([hidden])')")
        assert "a picture stands in its place" in text(tab, ".old")
        assert (
            tab.js("getComputedStyle(document.querySelector('.hero img')).visibility") == "visible"
        )
        assert tab.js("document.querySelectorAll('canvas').length") == 0
    finally:
        tab.call("Page.removeScriptToEvaluateOnNewDocument", identifier=made["identifier"])


def test_on_paper_pictures_stand_in_place_of_the_view(desk):
    desk.call("Emulation.setEmulatedMedia", media="print")
    seen = desk.js(
        "['.hero img', '.hero canvas', '#card', '.bar'].map((s) => { const t = getComputedStyle("
        "document.querySelector(s)); return t.display !== 'none' && t.visibility === 'visible' })"
    )
    desk.call("Emulation.setEmulatedMedia", media="")
    assert seen == [True, False, False, False]


def test_engraving_is_drawn_on_the_sheets(desk):
    drawn = desk.js(
        "[...document.querySelectorAll('.sheet g.part')].filter((g) => g.querySelector('.engrave'))"
        ".map((g) => g.dataset.mark)"
    )
    assert sorted(drawn) == sorted(sample().engraving)
