from taught import FEATURES, make_novice

from lira.fusion.methods.rivals.cloning import Cloning
from lira.hal.messages import Call

FAR = (-1.0, 1.0)


def test_the_human_always_drives_and_training_waits_for_the_end_of_the_lap():
    novice, trainer = make_novice(trained=False, labels_per_step=3, filter_human=False)
    method = Cloning(novice)
    for now_s in range(10):
        method.update(now_s)
        proposal = method.propose(FEATURES)
        assert (proposal.choice.driver, proposal.choice.call) == ("none", Call.FEEDBACK)
        assert method.learn(proposal, FAR if now_s % 2 else proposal.novice).stored  # known or not
    assert (trainer.started, novice.trained) == (0, False)
    method.reset()
    assert (trainer.started, novice.training_steps) == (3, 3)  # 10 labels, and one is carried
    for _ in range(2):
        method.learn(method.propose(FEATURES), FAR)
    method.reset()
    assert trainer.started == 4


def test_where_nobody_drives_nothing_is_learned():
    novice, trainer = make_novice()
    method = Cloning(novice)
    lesson = method.learn(method.propose(FEATURES), None)
    assert (lesson.choice.label, lesson.stored, trainer.labels) == (None, False, [])
