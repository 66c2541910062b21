"""What a method is asked is told, and the method is none the wiser."""

import numpy as np
import pytest
from taught import FEATURES, make_novice, play

from lira.fusion.learning.labels import Label
from lira.fusion.log.method_trace import MOST_BYTES, Decided, kept, restored, traced
from lira.fusion.methods.base import Alone, Chooser
from lira.fusion.methods.lira import LiraSettings, LiraSpf
from lira.fusion.methods.plus import LiraPlus, PlusSettings
from lira.hal.messages import CallName, Phase
from lira.hal.profile import load_profile

STRAIGHT = (1.0, 0.0)


def make(kind=LiraSpf, settings=None):
    told = []
    novice, _ = make_novice(trained=False)
    experts = [play(name, [STRAIGHT] * 50) for name in ("camera", "lidar")]
    method = kind(experts, novice, settings or LiraSettings(), 0.2)
    return traced(method, b'{"what": 1}', told.append), told


def names(told):
    return [[(call.name, call.target) for call in message.calls] for message in told]


def test_a_step_is_one_message_told_when_it_is_over():
    method, told = make()
    method.update(0.2)
    proposal = method.propose(FEATURES)
    assert names(told) == [[(CallName.BEGIN, 0)]]
    method.learn(proposal, (0.5, -0.5))
    assert names(told)[1:] == [[(CallName.UPDATE, 0), (CallName.PROPOSE, 0), (CallName.LEARN, 0)]]
    update, proposed, learned = told[1].calls
    assert told[1].stamp_s == update.time_s == 0.2
    assert proposed.features == kept(FEATURES)
    assert learned.action == (0.5, -0.5)


def test_a_step_in_which_nothing_was_learned_is_told_with_the_next():
    method, told = make()
    method.update(0.2)
    method.propose(FEATURES)
    method.update(0.4)
    assert names(told)[1:] == [[(CallName.UPDATE, 0), (CallName.PROPOSE, 0)]]


def test_settings_come_first_and_the_end_last():
    method, told = make()
    method.close()
    assert told[0].calls[0].argument == '{"what": 1}'
    assert names(told)[-1] == [(CallName.END, 0)]


def test_who_drives_alone_is_told_of_by_number():
    method, told = make()
    first, second = method.alone(Phase.PROVE), method.alone(Phase.UNSEEN)
    for driver in (second, first):
        driver.update(1.0)
        driver.learn(driver.propose(FEATURES), None)
    assert [name for message in names(told) for name in message][1:] == [
        (CallName.ALONE, 0),
        (CallName.ALONE, 0),
        *((name, 2) for name in (CallName.UPDATE, CallName.PROPOSE, CallName.LEARN)),
        *((name, 1) for name in (CallName.UPDATE, CallName.PROPOSE, CallName.LEARN)),
    ]


def test_it_lets_choose_whoever_may_be_chosen_and_only_then():
    plain, _ = make()
    assert not isinstance(plain, Chooser)
    plus, told = make(LiraPlus, PlusSettings(prefill=0))
    assert isinstance(plus, Chooser)
    assert set(plus.offers) == {"camera", "lidar"}
    assert plus.choose("nobody") is not None
    assert plus.choose("lidar") is None
    plus.update(1.0)
    assert [call.argument for call in told[-1].calls] == ["nobody", "lidar"]


def test_many_labels_from_before_are_told_in_bounded_messages():
    method, told = make()
    for _ in range(100):
        method.remember(Label(FEATURES, STRAIGHT, "human"))
    method.close()
    sizes = [sum(len(each.data) for call in message.calls for each in call.features) for message in told]
    assert sum(size > 0 for size in sizes) > 1
    assert max(sizes) < 2 * MOST_BYTES
    assert sum(call.name is CallName.REMEMBER for message in told for call in message.calls) == 100


def test_what_it_proposes_and_learns_is_what_the_method_does():
    method, _ = make()
    method.update(0.2)
    proposal = method.propose(FEATURES)
    assert proposal.features is FEATURES
    assert Decided.of(proposal).choice == proposal.choice
    assert isinstance(method.alone(Phase.PROVE)._method, Alone)


def test_features_come_back_to_the_bit():
    profile = load_profile("thesis-sim")
    shape = profile.features
    random = np.random.default_rng(3)
    image = (random.integers(0, 256, (shape.image_px, shape.image_px)) / 255).astype(np.float32)
    seen = type(FEATURES)(image=image, scan=random.uniform(0, 1, shape.bins).astype(np.float32))
    back = restored(kept(seen), profile)
    assert all(np.array_equal(back[name], seen[name]) for name in ("image", "scan"))
    with pytest.raises(KeyError):
        restored((type(kept(seen)[0])("smell", b"1"),), profile)
