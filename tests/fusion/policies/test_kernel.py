"""The regression: against the textbook's formulas solved at once, and what leaving out and setting aside mean."""

import math
from functools import partial

import numpy as np
import pytest

from lira.fusion.inference.kernel_net import kernel, parts, unit
from lira.fusion.policies.kernel import GAINS, KernelRidge, KernelSettings

CAMERA, LIDAR = 6, 4
SIZES = {"image": CAMERA, "scan": LIDAR}
BOTH = parts((CAMERA, LIDAR))
WIDTHS = np.array([0.4, 0.4]) ** 2
EVEN = partial(KernelSettings, lengths=())  # one length scale for all parts
PLAIN = EVEN(contradicts=None)


def states(count, seed=0, spread=0.3):
    """States x [count, 10], some of them near each other."""
    random = np.random.default_rng(seed)
    middles = random.standard_normal((4, CAMERA + LIDAR))
    near = middles[np.arange(count) % 4] + spread * random.standard_normal((count, CAMERA + LIDAR))
    return units(near)


def units(rows, sizes=(CAMERA, LIDAR)):
    """Each row with parts of length 1."""
    return np.stack([unit(row, parts(sizes)) for row in np.asarray(rows, np.float32)])


def squared(x, size):
    """Squared distances of all pairs, in the first part and in the second."""
    apart = [part[:, None] - part[None] for part in (x[:, :size], x[:, size:])]
    return [(each.astype(np.float64) ** 2).sum(axis=2) for each in apart]


def taught(x, actions, settings=PLAIN, *, human=None, groups=None, weights=None):
    ridge = KernelRidge(SIZES, settings)
    for i, action in enumerate(actions):
        ridge.add(
            x[i],
            action,
            1.0 if weights is None else weights[i],
            human=True if human is None else human[i],
            group=i if groups is None else groups[i],
            label=i,
        )
    return ridge


def actions(count, seed=0):
    return [tuple(row) for row in np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 2)).tolist()]


def test_each_part_of_a_state_has_length_1_and_a_state_is_like_itself():
    x = states(5)
    np.testing.assert_allclose(np.linalg.norm(x[:, :CAMERA], axis=1), 1.0, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(x[:, CAMERA:], axis=1), 1.0, rtol=1e-6)
    np.testing.assert_allclose(kernel(x, x, BOTH, WIDTHS).diagonal(), 1.0, atol=1e-5)


def test_a_part_that_is_zero_stays_finite():
    assert not unit(np.zeros(CAMERA + LIDAR, np.float32), BOTH).any()


def test_the_kernel_is_gaussian_in_both_parts():
    x = states(6)
    camera, lidar = squared(x, CAMERA)
    expected = np.exp(-camera / (2 * 0.5**2) - lidar / (2 * 0.3**2))
    np.testing.assert_allclose(kernel(x, x, BOTH, np.array([0.5, 0.3]) ** 2), expected, atol=1e-5)


def test_each_feature_has_a_length_scale_by_its_name_however_many_there_are():
    sizes = {"image": 6, "scan": 4, "depth": 5}
    x = units(np.random.default_rng(1).standard_normal((7, 15)), tuple(sizes.values()))
    ridge = KernelRidge(sizes, KernelSettings(length=0.5, lengths=(("depth", 0.3),)))
    for i in range(7):
        ridge.add(x[i], (1.0, 0.0), 1.0, human=True, group=i, label=i)
    seen, depth = squared(x, 10)  # two parts with one length scale are like one
    expected = np.exp(-seen / (2 * 0.5**2) - depth / (2 * 0.3**2))
    np.testing.assert_allclose(ridge.k(x[3]), expected[3], atol=1e-5)


def test_one_by_one_it_comes_to_what_solving_at_once_does():
    x, labels, weights = states(30), actions(30), [1.0 + i % 3 for i in range(30)]
    ridge = taught(x[:29], labels[:29], weights=weights)
    k, at = kernel(x[:29], x[:29], BOTH, WIDTHS), kernel(x[:29], x[29:], BOTH, WIDTHS)[:, 0]
    with_noise = k + np.diag(0.1 / np.array(weights[:29]))
    mean = at @ np.linalg.solve(with_noise, np.array(labels[:29]))
    variance = 1.0 - at @ np.linalg.solve(with_noise, at)
    assert ridge.act(x[29]) == pytest.approx(np.clip(mean, -1.0, 1.0), abs=1e-5)
    assert ridge.fit.deviation(ridge.k(x[29])) == pytest.approx(ridge.fit.scale * np.sqrt(variance), abs=1e-5)


def test_it_knows_what_it_was_shown_and_stands_where_it_was_shown_nothing():
    axes = np.eye(CAMERA + LIDAR, dtype=np.float32)
    x = axes[:2] + axes[[CAMERA, CAMERA + 1]]
    ridge = taught(x[:1], [(0.9, -0.8)], EVEN(noise=1e-3))
    assert ridge.act(x[0]) == pytest.approx((0.9, -0.8), abs=0.01)
    assert ridge.act(x[1]) == pytest.approx((0.0, 0.0), abs=0.01)
    known, unknown = (ridge.fit.deviation(ridge.k(each))[1] for each in x)
    assert known < 0.1 * unknown


def test_several_states_are_asked_about_at_once_as_one_by_one():
    x, ridge = states(20), taught(states(12), actions(12))
    at_once = ridge.k(x)
    np.testing.assert_allclose(at_once, [ridge.k(each) for each in x], atol=1e-5)
    one_by_one = [ridge.fit.deviation(ridge.k(each)) for each in x]
    np.testing.assert_allclose(ridge.fit.deviation(at_once), one_by_one, atol=1e-5)


def test_what_is_known_of_a_state_is_forgotten_with_the_next_example():
    x = states(3)
    ridge = taught(x[:1], actions(1))
    assert len(ridge.k(x[2])) == 1
    ridge.add(x[1], (1.0, 0.0), 1.0, human=True, group=1, label=1)
    np.testing.assert_array_equal(ridge.k(x[2]), kernel(ridge.x, x[2:], BOTH, WIDTHS)[:, 0])


def test_before_any_label_it_stands():
    ridge = KernelRidge(SIZES, EVEN())
    assert ridge.act(states(1)[0], ridge.gain) == (0.0, 0.0)
    assert ridge.fit.deviation(ridge.k(states(1)[0])).tolist() == [1.0, 1.0]


def test_a_group_is_left_out_as_if_it_had_never_been_shown():
    x, labels, groups = states(24), actions(24), [i // 4 for i in range(24)]
    residual, variance = taught(x, labels, groups=groups).fit.left_out
    for group in range(6):
        inside = [i for i in range(24) if groups[i] == group]
        others = [i for i in range(24) if groups[i] != group]
        without = taught(x[others], [labels[i] for i in others])
        for i in inside:
            k = without.k(x[i])
            assert residual[i] == pytest.approx(labels[i] - without.fit.mean(k), abs=1e-5)
            assert float(variance[i]) == pytest.approx(float(1.1 - k @ without.fit.p @ k), abs=1e-5)


def test_the_deviation_is_calibrated():
    """On a function drawn from the prior, 95 % of the errors are below two deviations, more or less."""
    x = states(400, seed=1)
    k = kernel(x, x, BOTH, WIDTHS) + 1e-4 * np.eye(400)
    draw = 0.3 * np.linalg.cholesky(k) @ np.random.default_rng(2).standard_normal((400, 2))
    noisy = draw + 0.3 * math.sqrt(0.1) * np.random.default_rng(3).standard_normal((400, 2))
    ridge = taught(x[:200], [tuple(row) for row in noisy[:200].tolist()])
    errors = [
        (abs(float(ridge.fit.mean(ridge.k(x[i]))[1] - draw[i, 1])), float(ridge.fit.deviation(ridge.k(x[i]))[1]))
        for i in range(200, 400)
    ]
    assert 0.9 < np.mean([error < 2.0 * deviation for error, deviation in errors]) <= 1.0
    assert ridge.fit.scale.tolist() == pytest.approx([0.3, 0.3], rel=0.2)


class TestSettingAside:
    def scene(self, *, human):
        """Twelve labels of one mind in much the same place, and one that turns the other way."""
        x = units(1.0 + 0.05 * states(13))
        labels = [(1.0, 0.9)] * 12 + [(1.0, -0.9)]
        return taught(x, labels, EVEN(), human=human), x

    def test_a_label_that_contradicts_all_others_leaves_the_fit_and_is_kept(self):
        ridge, x = self.scene(human=[True] * 13)
        assert ridge.fit.used.tolist() == [True] * 12 + [False]
        assert (len(ridge), ridge.aside) == (13, {12: 12})
        plain = taught(x[:12], [(1.0, 0.9)] * 12)
        assert ridge.act(x[12]) == pytest.approx(plain.act(x[12]), abs=1e-6)

    def test_an_expert_goes_before_a_human(self):
        x = units(1.0 + 0.01 * states(2))
        ridge = taught(x, [(1.0, 1.0), (1.0, -1.0)], EVEN(), human=[True, False])
        assert ridge.fit.used.tolist() == [True, False]

    def test_it_can_be_left_off(self):
        x = units(1.0 + 0.05 * states(13))
        assert taught(x, [(1.0, 0.9)] * 12 + [(1.0, -0.9)]).fit.used.all()


def test_the_gain_makes_up_for_turns_that_are_predicted_too_small():
    x = states(40, spread=0.1)
    same = taught(x, [(1.0, 0.5)] * 40)
    assert same.gain == pytest.approx(1.0, abs=0.25)
    mixed = taught(x, [(1.0, (-1.0, 1.0, 1.0)[i % 3]) for i in range(40)])
    assert 1.2 < mixed.gain <= GAINS[1]
    linear, angular = mixed.act(x[0])
    assert mixed.act(x[0], 1.5) == pytest.approx((linear, max(-1.0, min(1.0, 1.5 * angular))))


def test_a_gain_that_is_set_is_used():
    assert taught(states(4), actions(4), EVEN(gain=1.4)).gain == 1.4


def test_where_there_are_too_many_the_expert_s_label_goes_that_the_others_say_best():
    x = states(8)
    labels = [(1.0, 0.0)] * 4 + [(1.0, 0.9), (0.2, -0.9), (1.0, 0.0), (1.0, 0.0)]
    human = [False, False, False, False, True, True, False, True]
    ridge = taught(x, labels, EVEN(contradicts=None, most=6), human=human)
    assert len(ridge) == 6
    assert [i for i in range(8) if any(np.array_equal(x[i], row) for row in ridge.x)] == ridge.labels.tolist()
    assert ridge.human.tolist().count(True) == 3
    left = [i for i in range(8) if any(np.array_equal(x[i], row) for row in ridge.x)]
    whole = taught(x[left], [labels[i] for i in left])
    assert ridge.act(x[0]) == pytest.approx(whole.act(x[0]), abs=1e-6)
