import re
from html.parser import HTMLParser

import msgspec
import pytest
from synthetic_run import write_run

from lira.fusion.log.run_log import LapRecord, StepRecord, read_run
from lira.hal.errors import StorageError
from lira.sim_backend.catalogue import load_world
from lira.tools import cli
from lira.tools.report import write_report
from lira.tools.report.course import NOTHING, course
from lira.tools.report.digest import digest, load_run
from lira.tools.report.plots import histogram, nice_step, top_view

VOID = {"meta", "img", "br"}


class Page(HTMLParser):
    """Checks nesting and collects what the page would load."""

    def __init__(self, text):
        super().__init__()
        self.open, self.loads, self.headings, self.count = [], [], [], {}
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.count[tag] = self.count.get(tag, 0) + 1
        self.loads += [value for name, value in attrs if name in ("src", "href", "srcset", "data")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.count[tag] = self.count.get(tag, 0) + 1

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "h2":
            self.headings.append(data)


@pytest.fixture(scope="module")
def run_file(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def page_text(run_file):
    return write_report(run_file.parent).read_text(encoding="utf-8")


def test_the_page_is_well_formed_and_has_every_part(page_text):
    page = Page(page_text)
    assert page.headings == [
        "Laps",
        "What it asked of the person",
        "Where it drove",
        "Who drove when",
        "What it learned from",
        "What it saw when it called",
    ]
    assert page.count["svg"] == 6 + 7 + 2  # views: 2 training, 1 proving, 3 unseen; strips: 7 laps; densities: 2
    assert page.count["tr"] == 1 + 7 + 1 + 2  # laps; what two training laps asked of the person


def test_the_page_loads_nothing_from_elsewhere(page_text):
    page = Page(page_text)
    assert page.loads
    assert all(source.startswith("data:image/png;base64,") for source in page.loads)
    assert not re.search(r"https?://|url\(|@import|<script|<link", page_text)


def test_the_page_is_small(page_text):
    assert len(page_text) < 500_000


def test_words_from_the_run_are_escaped(page_text):
    assert "--note &#x27;&lt;b&gt;&amp;&#x27;" in page_text
    assert "'<b>&'" not in page_text


def test_the_outcome_and_the_unseen_collisions_are_told(page_text):
    assert "Proven after 2 training laps: the novice alone passed the layout it was taught on" in page_text
    assert "passed 2 of 3 unseen layouts; 95 %: 9 to 99 %; collisions: 1, lost lines: 0" in page_text


def test_a_run_that_was_cut_off_still_gives_a_page(tmp_path):
    path = write_run(tmp_path, ended=False)
    text = path.read_bytes()
    path.write_bytes(text[: text.rindex(b'"type":"lap"') - 500])  # torn in the middle of the last lap
    page = write_report(tmp_path).read_text(encoding="utf-8")
    Page(page)
    assert "Cut off before its end" in page
    assert "cut off</td>" in page


def test_pictures_are_bounded(tmp_path):
    path = write_run(tmp_path, unseen=0)
    lines = path.read_bytes().splitlines(keepends=True)
    calls = [line for line in lines if b'"image":"' in line]
    path.write_bytes(b"".join([*lines[:-1], *calls * 40, lines[-1]]))
    assert Page(write_report(tmp_path).read_text(encoding="utf-8")).count["img"] == 24


def test_a_run_without_ground_truth_has_no_top_view(tmp_path):
    path = write_run(tmp_path, unseen=0)
    blind = [
        msgspec.structs.replace(record, state=None) if isinstance(record, StepRecord) else record
        for record in read_run(path)
    ]
    path.write_bytes(b"".join(msgspec.json.encode(record) + b"\n" for record in blind))
    assert "only a twin knows where the robot is" in write_report(tmp_path).read_text(encoding="utf-8")


def test_laps_are_told_apart_and_so_are_days(run_file):
    records = list(read_run(run_file))
    laps = [record for record in records if isinstance(record, LapRecord)]
    told = [(lap.phase, lap.lap, lap.layout) for lap in laps]
    run = digest(records + records)
    assert [(lap.phase, lap.number, lap.layout, lap.day) for lap in run.laps] == [
        (*lap, day) for day in (1, 2) for lap in told
    ]
    run = digest(records)
    assert [(lap.phase, lap.number, lap.layout) for lap in run.laps] == told
    assert sum(len(lap.steps) for lap in run.laps) == sum(isinstance(record, StepRecord) for record in records)
    assert run.experts == ("camera", "lidar")


def test_labels_are_counted_by_source(run_file):
    labels = load_run(run_file).labels()
    stored = [record.label for record in read_run(run_file) if isinstance(record, StepRecord) and record.label]
    assert len(labels["human"]) == stored.count("human") > 0
    assert len(labels["expert"]) == len(stored) - stored.count("human") > 0


def test_a_crash_is_marked_where_the_robot_was_before_it_was_put_back(run_file):
    run = load_run(run_file)
    unharmed, harmed = [lap for lap in run.phase("unseen") if lap.layout in (1, 2)]
    assert 'class="crash"' not in top_view(unharmed, NOTHING, run.experts)[0]
    assert 'class="crash"' in top_view(harmed, NOTHING, run.experts)[0]


def test_a_long_straight_course_is_wide(tmp_path):
    run = load_run(write_run(tmp_path, world="race", unseen=0))
    assert top_view(run.laps[0], course("race", 0), run.experts)[1]


def test_a_world_that_is_gone_is_drawn_as_empty_floor():
    assert course("gone.toml", 0) == NOTHING


@pytest.mark.parametrize(
    ("world", "painted", "way", "hanging", "marks"),
    [
        ("line-obstacles", True, False, 0, False),
        ("corridor", False, True, 0, True),  # nobody sees the way; spots are painted on the floor
        ("garden", True, True, 1, True),  # the edge is painted beside the way
        ("passage", False, True, 1, False),  # a way is closed above the lidar
        ("forest", False, False, 0, False),
    ],
)
def test_the_floor_is_drawn_as_it_is(world, painted, way, hanging, marks):
    floor = course(world, 0)
    assert (bool(floor.line), bool(floor.way), bool(floor.marks)) == (painted, way, marks)
    assert len(floor.hanging) == hanging


def test_paint_beside_the_way_lies_beside_it():
    floor, offset_m = course("garden", 0), load_world("garden").line.offset_m
    (x, y), (way_x, way_y) = floor.line[0], floor.way[0]  # the way begins along x
    assert (x, y) == pytest.approx((way_x, way_y + offset_m))


def test_what_hangs_is_framed_over_the_track_and_no_box(tmp_path):
    run = load_run(write_run(tmp_path, world="passage", unseen=0))
    drawn, _ = top_view(run.laps[0], course("passage", 0), run.experts)
    assert drawn.index('class="hanging"') > drawn.rindex('class="steps')
    assert drawn.index('class="way"') < drawn.index('class="steps')
    assert 'class="course"' not in drawn


def test_every_value_falls_into_a_bin():
    counts = histogram([-1.0, -1.2, 0.0, 1.0, 1.7])
    assert counts[0] == 2
    assert counts[10] == 1
    assert counts[-1] == 2


@pytest.mark.parametrize(("tallest", "step"), [(1, 1), (4, 1), (7, 2), (20, 5), (37, 10), (91, 50), (380, 100)])
def test_grid_steps_are_round(tallest, step):
    assert nice_step(tallest) == step


@pytest.mark.parametrize("content", [None, b"", b"not json\n"])
def test_no_record_is_one_clear_error(tmp_path, content):
    if content is not None:
        (tmp_path / "run.jsonl").write_bytes(content)
    with pytest.raises(StorageError) as error:
        write_report(tmp_path)
    assert error.value.remedy


def test_the_verb_prints_the_path(run_file, capsys):
    assert cli.main(["report", str(run_file)]) == 0
    assert capsys.readouterr().out.strip() == str(run_file.parent / "report.html")
