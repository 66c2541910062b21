import subprocess
import sys
from types import SimpleNamespace

import pytest
from fresh import lira

from lira.fusion.experts.files import EXPERTS
from lira.fusion.methods.presets import METHODS
from lira.hal.errors import ConfigError
from lira.tools import cli
from lira.tools.verbs import VERBS, Verb


@pytest.fixture
def verb(monkeypatch):
    """Add a verb to the table whose `run` is the function given."""

    def install(run):
        def add_arguments(parser):
            parser.add_argument("--count", type=int, default=1)

        module = SimpleNamespace(__doc__="Test.\n\nexample: none\n", add_arguments=add_arguments, run=run)
        monkeypatch.setitem(sys.modules, "verb_for_test", module)
        monkeypatch.setitem(VERBS, "try", Verb("verb_for_test", "a verb for tests"))

    return install


def test_help_lists_every_verb_and_needs_only_the_standard_library():
    done = lira("--help", block=["numpy", "zenoh", "torch", "pybullet", "msgspec", "cv2", "rosbags"])
    assert done.returncode == 0, done.stderr
    assert all(name in done.stdout for name in VERBS)


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself(verb, capsys):
    with pytest.raises(SystemExit) as end:
        cli.main([verb, "--help"])
    assert end.value.code == 0
    assert f"usage: lira {verb}" in capsys.readouterr().out


def test_the_help_of_what_makes_an_expert_or_drives_by_one_names_every_sensor(capsys):
    assert all(sensor in VERBS["train-expert"].help for sensor in EXPERTS)
    with pytest.raises(SystemExit):
        cli.main(["drive", "--help"])
    said = capsys.readouterr().out
    assert all(f"{sensor}-expert" in said for sensor in EXPERTS)


def test_the_help_of_the_learner_does_not_pass_a_few_methods_off_as_all():
    assert "any method" in VERBS["fusion"].help
    assert not any(method in VERBS["fusion"].help.lower() for method in METHODS)


def test_the_help_of_record_names_every_verb_that_records_by_itself(capsys):
    recorded = []
    for verb in VERBS:
        with pytest.raises(SystemExit):
            cli.main([verb, "--help"])
        recorded += [verb] if "--no-record" in capsys.readouterr().out else []
    with pytest.raises(SystemExit):
        cli.main(["record", "--help"])
    said = capsys.readouterr().out
    assert recorded
    assert all(f"`lira {verb}`" in said for verb in recorded)


def test_no_words_is_help(capsys):
    assert cli.main([]) == 0
    assert "lira demo" in capsys.readouterr().out


def test_version(capsys):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("lira 0.")


def test_an_unknown_verb_names_the_nearest(capsys):
    assert cli.main(["twinn"]) == 2
    error = capsys.readouterr().err
    assert error.splitlines()[0] == "lira: unknown verb 'twinn'"
    assert "Did you mean `twin`?" in error


def test_an_unknown_verb_like_no_other_gets_the_list(capsys):
    assert cli.main(["xyzzy"]) == 2
    error = capsys.readouterr().err
    assert "Did you mean" not in error
    assert "demo" in error


def test_an_error_is_two_lines_and_exit_2(verb, capsys):
    def run(args):
        raise ConfigError("unknown world 'moon'", "Known worlds: line.")

    verb(run)
    assert cli.main(["try"]) == 2
    assert capsys.readouterr().err == "lira try: unknown world 'moon'\n  Known worlds: line.\n"


def test_the_status_and_the_arguments_pass_through(verb):
    verb(lambda args: args.count)
    assert cli.main(["try", "--count", "1"]) == 1
    assert cli.main(["try", "--count", "0"]) == 0


def test_ctrl_c_is_quiet(verb, capsys):
    def run(args):
        raise KeyboardInterrupt

    verb(run)
    assert cli.main(["try"]) == 130
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("package", "extra"), cli.EXTRAS.items())
def test_a_missing_package_names_its_extra(verb, capsys, package, extra):
    def run(args):
        raise ModuleNotFoundError(f"No module named {package!r}", name=f"{package}.part")

    verb(run)
    assert cli.main(["try"]) == 2
    assert f"pip install 'lira-rosbot[{extra}]'" in capsys.readouterr().err


def test_a_module_of_ours_that_is_missing_is_a_bug_and_shows(verb):
    def run(args):
        raise ModuleNotFoundError("No module named 'lira.hal.nothing'", name="lira.hal.nothing")

    verb(run)
    with pytest.raises(ModuleNotFoundError):
        cli.main(["try"])


def test_a_reader_that_leaves_early_causes_no_traceback():
    reader = subprocess.Popen(["true"], stdin=subprocess.PIPE)
    reader.wait()
    code = "import sys, time; time.sleep(0.2); from lira.tools.cli import main; sys.exit(main(['--help']))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        stdout=reader.stdin,
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
        check=False,
    )
    reader.stdin.close()
    assert done.stderr == ""
    assert done.returncode == cli.EXIT_BROKEN_PIPE
