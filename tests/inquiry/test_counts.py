"""One run, and every verb that counts its labels: they agree."""

from collections import Counter
from functools import partial

from recorded_run import write_reports
from short_worlds import FEW_METRES

from lira.fusion.inference.threads import one_thread
from lira.fusion.learning.trainer import InlineTrainer
from lira.fusion.log.label_log import read_demonstrations
from lira.fusion.methods.presets import method_named
from lira.hal.messages import Driver
from lira.tools.cli import main
from lira.tools.inquiry.otherwise import compare
from lira.tools.inquiry.rerun import go_again
from lira.tools.inquiry.trace import read_traces
from lira.tools.output.label_words import by_source, learned_words
from lira.tools.recording.reader import Recording
from lira.tools.report.digest import load_run
from lira.tools.runs.names import LABELS, RECORD
from lira.tools.runs.plan import Plan
from lira.tools.runs.simulated import simulate
from lira.tools.runs.teach import teach_on


def test_record_log_report_and_rerun_count_the_same_labels(tmp_path, capsys):
    one_thread()
    world, folder, reports = tmp_path / "few.toml", tmp_path / "run", []
    world.write_text(FEW_METRES)
    with simulate(str(world), "thesis-sim", renderer="sketch") as robot:
        trainer = partial(InlineTrainer, adopt_after_s=robot.profile.period_s)
        plan = Plan(method_named("plus"), laps=1, unseen=0, pair="line", folder=folder)
        teach_on(robot, robot.arena, robot.arena.world, plan, trainer, publish=reports.append)
        profile = robot.profile
    recorded = load_run(folder / RECORD)
    result = recorded.result
    log = list(read_demonstrations(folder / LABELS))
    learned = Counter(label.source for label in log if label.stored)
    assert learned.total() > 5
    assert result.buffer == learned.total()
    assert Counter(result.account.stored) == learned
    shown = {who: len(actions) for who, actions in recorded.labels().items()}
    assert shown == {"human": learned[Driver.HUMAN], "expert": learned.total() - learned[Driver.HUMAN]}

    (trace,) = read_traces(Recording(write_reports(folder / "recording", profile, reports)))
    again = go_again(trace, profile)
    assert again.final.labels == learned.total()
    rows = {row.name: row.was for row in compare(again).rows}
    assert rows["labels learned"] == learned.total()
    assert {source: rows[f"labels learned: {source}"] for source in learned} == dict(learned)

    words = learned_words(result)
    assert f"{learned.total()} labels learned ({by_source(learned)}); human labels: {result.human_labels}" in words
    assert main(["labels", "list", str(folder / LABELS)]) == 0
    assert main(["rerun", str(folder)]) == 0
    out = capsys.readouterr().out
    assert f"{len(log)} labels given, {learned.total()} of them learned" in out
    assert f"decisions, {learned.total()} labels learned," in out
