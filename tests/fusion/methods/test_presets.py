import msgspec
import pytest

from lira.fusion.methods.lira import LiraSettings
from lira.fusion.methods.presets import ALIASES, METHODS, RIVALS, Preset, method_named
from lira.fusion.methods.rivals.hg_dagger import HgDaggerSettings
from lira.fusion.methods.syllabus import FRESH
from lira.hal.errors import ConfigError


def test_every_method_goes_through_json_as_it_is():
    for name, method in METHODS.items():
        assert method.name == name
        assert msgspec.json.decode(msgspec.json.encode(method), type=Preset) == method
    assert len({msgspec.json.encode(method) for method in METHODS.values()}) == len(METHODS)


def test_the_thesis_is_to_the_letter_and_hold_is_the_default():
    assert METHODS["thesis"].approach == LiraSettings(hold=None)
    assert METHODS["hold"].approach == LiraSettings()
    assert method_named("lira") is METHODS["hold"]
    assert not set(ALIASES) & set(METHODS)


def test_what_is_beyond_a_method_is_off_unless_its_name_says_so():
    for name in ("hold", "thesis", "hg-dagger"):
        method = METHODS[name]
        assert (method.warm, method.mirrored, method.sharing) == ((), False, None)
        assert method.learning.labels_per_step == 30
    assert METHODS["hg-dagger"].approach == HgDaggerSettings(doubt=())
    assert METHODS["hg-dagger-warm-m10"].learning.labels_per_step == 10
    assert METHODS["hg-dagger-warm-m10"].warm == METHODS["hg-dagger-warm"].warm == ("camera", "lidar")


def test_only_who_has_experts_begins_with_their_trunks():
    alone = {"hg-dagger-m10", "hg-dagger-mirrored", "hg-dagger-doubt", "hold-scratch"}
    alone |= {name for method in RIVALS for name in (method.name, f"{method.name}-fresh")}
    assert {name for name, method in METHODS.items() if method.trunks == "frozen"} == set(METHODS) - alone


def test_only_plus_and_what_is_named_so_is_taught_and_proven_on_fresh_layouts():
    for name, method in METHODS.items():
        fresh = name.startswith("plus") or name.endswith(("-fresh", "-kernel"))
        assert (method.syllabus == FRESH) == (fresh and name != "plus-own"), name


def test_who_learns_by_a_kernel_says_so_and_sees_as_the_experts_do():
    named = {name for name in METHODS if name.startswith("plus") or name.endswith("-kernel")} - {"plus-network"}
    assert {name for name, method in METHODS.items() if method.kernel is not None} == named
    assert all(METHODS[name].trunks == "frozen" and not METHODS[name].warm for name in named)


def test_every_rival_is_there_on_fresh_layouts_and_with_all_of_plus_but_its_method():
    for rival in (METHODS["hold"], *RIVALS):
        fresh, kernel = METHODS[f"{rival.name}-fresh"], METHODS[f"{rival.name}-kernel"]
        assert msgspec.structs.replace(fresh, name=rival.name, syllabus=rival.syllabus) == rival
        plus = msgspec.structs.replace(METHODS["plus"], name=kernel.name, approach=rival.approach)
        assert kernel == plus


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(ConfigError, match="unknown method 'dagger'") as refused:
        method_named("dagger")
    assert all(name in refused.value.remedy for name in [*ALIASES, *METHODS])
