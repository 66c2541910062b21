import numpy as np
import pytest
from nets import camera_net, fusion_net, kernel_net, lidar_net

from lira.fusion.experts.files import experts_of, folder_of
from lira.fusion.experts.load import as_expert, load_alone, load_network, load_policy
from lira.fusion.experts.tasks import DEFAULT, TASKS, task_of
from lira.fusion.inference.checkpoint import Checkpoint, save_checkpoint
from lira.fusion.methods.base import Alone
from lira.fusion.methods.shield import Shielded
from lira.fusion.methods.stop_and_ask import Doubtful
from lira.fusion.policies.networks import ExpertNet
from lira.fusion.preprocess import Features
from lira.hal.errors import ConfigError, StorageError
from lira.hal.profile import load_profile
from lira.sim_backend.catalogue import load_world

SIM, REAL = load_profile("thesis-sim"), load_profile("rosbot2")
FEATURES = Features(scan=np.full(101, 0.5, np.float32), image=np.full((32, 32), 0.5, np.float32))


def save(path, network, profile="rosbot2", cruise=None):
    save_checkpoint(path, network, Checkpoint.of(network, profile, "lira train-expert", 0, cruise))
    return str(path)


@pytest.mark.parametrize("name", ["camera", "lidar"])
def test_the_experts_that_come_with_the_project_load_by_name(name):
    expert = load_policy(f"{name}-expert", SIM)
    assert expert.name == name
    assert expert.cruise[0] > 0.9  # at full speed
    assert abs(expert.cruise[1]) < 0.1  # straight on
    linear, angular = expert.act(FEATURES)
    assert -1.0 <= linear <= 1.0
    assert -1.0 <= angular <= 1.0
    _, checkpoint = load_network(name, SIM)
    assert checkpoint.provenance.startswith(f"lira train-expert {name}")


EVERY = [(task, name) for task in TASKS for name in experts_of(load_profile(TASKS[task].profile))]


@pytest.mark.parametrize(("task", "name"), EVERY)
def test_every_task_has_its_experts_for_its_robot(task, name):
    profile = load_profile(TASKS[task].profile)
    assert load_policy(f"{name}-expert", profile, task).name == name
    _, checkpoint = load_network(name, profile, task)
    owner = TASKS[task].owner(name)
    words = "" if owner == DEFAULT else f" --task {owner}"
    robot = TASKS[owner].profile
    assert checkpoint.provenance == f"lira train-expert {name}{words} --profile {robot} --seed 0"
    assert checkpoint.labels > 30


def test_the_experts_of_a_world_are_those_of_its_task():
    assert [task_of(world) for world in ("race", "passage", "garden", "corridor", "my-own")] == [
        "line",
        "passage",
        "garden",
        "corridor",
        "line",
    ]
    assert all(load_world(world).name == world for task in TASKS.values() for world in task.worlds)


def test_a_pair_of_ones_own_is_a_folder(tmp_path):
    for network in (camera_net(16), lidar_net(101)):
        save(tmp_path / f"{network.kind}.safetensors", network, cruise=(0.9, 0.01))
        assert load_policy(f"{network.kind}-expert", SIM, str(tmp_path)).cruise == (0.9, 0.01)


def test_a_folder_without_the_expert_says_how_to_make_it(tmp_path):
    with pytest.raises(ConfigError, match=r"no lidar expert .*lidar.safetensors.*lira train-expert lidar .*--out"):
        load_policy("lidar-expert", SIM, str(tmp_path))


def test_a_seeded_pair_has_a_folder_of_its_own():
    assert folder_of("line@2").name == "line-2"


@pytest.mark.parametrize("pair", ["lane@1", "line@", "line@x", "@1"])
def test_a_seeded_pair_of_no_task_is_refused(pair):
    with pytest.raises(ConfigError, match=r"is no pair of experts.*line@1.*passage"):
        folder_of(pair)


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(ConfigError, match=r"unknown policy 'sonar-expert'.*camera-expert, lidar-expert.*safetensors"):
        load_policy("sonar-expert", SIM)


def test_a_profile_without_an_expert_says_how_to_train_one():
    with pytest.raises(ConfigError, match=r"'rosbot2'.*lira train-expert camera --profile rosbot2"):
        load_policy("camera-expert", REAL)


@pytest.mark.parametrize("pair", ["line", "table-top", "line@1"])
def test_an_expert_of_a_sensor_that_the_robot_does_not_learn_from_is_not_to_be_trained(pair):
    with pytest.raises(
        ConfigError, match=r"'thesis-sim' has no depth expert: it learns from image and scan"
    ) as refused:
        load_policy("depth-expert", SIM, pair)
    assert "train-expert" not in refused.value.remedy
    assert "thesis-sim-depth" in refused.value.remedy


def test_a_task_without_an_expert_names_those_that_have_one_to_drive_by():
    with pytest.raises(ConfigError, match=r"the task 'line' has no depth expert.*--experts table-top") as refused:
        load_policy("depth-expert", load_profile("thesis-sim-depth"))
    assert "train-expert" not in refused.value.remedy


def test_a_file_of_ones_own_is_named_after_its_sensor(tmp_path):
    path = save(tmp_path / "mine.safetensors", lidar_net(130, seed=1), cruise=(0.9, 0.01))
    expert = load_policy(path, REAL)
    assert (expert.name, expert.cruise) == ("lidar", (0.9, 0.01))


DEPTH_NET = ExpertNet("depth", (32, 32), 16)  # of a robot that learns from depth


@pytest.mark.parametrize("network", [lidar_net(130), camera_net(32), fusion_net(130, 32), fusion_net(101, 32)])
def test_the_checkpoint_of_another_robot_is_refused_with_both_names(tmp_path, network):
    path = save(tmp_path / "other.safetensors", network)
    own = r"'thesis-sim' \(image 32x32, scan 101, filters 16\)"
    with pytest.raises(ConfigError, match=rf"trained for 'rosbot2'.*not for {own}") as refused:
        load_network(path, SIM)
    assert "--profile rosbot2" in refused.value.remedy


def test_a_checkpoint_that_needs_a_sensor_more_names_it_and_who_has_it(tmp_path):
    path = save(tmp_path / "novice.safetensors", DEPTH_NET, "thesis-sim-depth")
    with pytest.raises(ConfigError) as refused:
        load_policy(path, SIM)
    assert refused.value.what == (
        f"{path} was trained for 'thesis-sim-depth' and needs its depth; "
        "a robot of the profile 'thesis-sim' learns from image and scan alone"
    )
    assert refused.value.remedy == "With --profile thesis-sim-depth the robot learns from depth."


def test_what_an_expert_does_not_see_may_differ(tmp_path):
    path = save(tmp_path / "camera.safetensors", camera_net(16))
    assert load_policy(path, SIM).name == "camera"


def test_a_missing_file_is_one_clear_error(tmp_path):
    with pytest.raises(StorageError, match="there is no checkpoint"):
        load_policy(str(tmp_path / "none.safetensors"), SIM)


def test_an_expert_is_a_black_box_that_sees_both_sensors():
    network = fusion_net(101, 16, seed=3).driving()
    assert as_expert("both", network, None).act(FEATURES) == network.act(FEATURES)
    assert as_expert("both", network, None).cruise == (1.0, 0.0)


def test_a_policy_that_cannot_tell_what_it_knows_cannot_ask():
    assert load_alone("camera-expert", SIM).name == "camera"
    with pytest.raises(ConfigError, match="cannot tell what it does not know"):
        load_alone("camera-expert", SIM, ask=True)


def test_a_novice_of_plus_can(tmp_path):
    path = save(tmp_path / "novice.safetensors", kernel_net(SIM.features.bins, SIM.features.filters), SIM.name)
    assert isinstance(load_alone(path, SIM, ask=True), Doubtful)
    assert isinstance(load_alone(path, SIM), Alone)


def test_whatever_drives_alone_may_drive_behind_a_shield():
    method = load_alone(lambda _: (1.0, 0.0), SIM, shield=True)
    assert isinstance(method, Shielded)
    assert method.propose(FEATURES).command == (1.0, 0.0)
