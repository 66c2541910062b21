import json
import re
from importlib.util import find_spec
from pathlib import Path

from fresh import python

from lira.tools import bench, cli

FAKE = """
import os, sys, types
module = types.ModuleType("lira.tools.bench.twin")
def run():
    print("chatter from Python")
    os.write(1, b"chatter from C\\n")
    return [{"profile": "thesis-sim", "real_time_factor": 61.23456}, {"profile": "rosbot2", "renderer": "egl"}]
module.run = run
sys.modules["lira.tools.bench.twin"] = module
from lira.tools.cli import main
sys.exit(main(sys.argv[1:]))
"""


def lira(*words):
    return python(FAKE, *words)


def test_json_to_stdout_is_one_object_and_nothing_else():
    done = lira("bench", "twin", "--json", "-")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert list(found) == ["name", "machine", "results"]
    assert found["name"] == "twin"
    assert found["results"][0] == {"profile": "thesis-sim", "real_time_factor": 61.23456}
    assert "chatter from C" in done.stderr


def test_json_to_a_file_also_prints_the_table(tmp_path):
    path = tmp_path / "twin.json"
    done = lira("bench", "twin", "--json", str(path))
    assert json.loads(path.read_text())["name"] == "twin"
    assert "61.2" in done.stdout


def test_a_file_that_cannot_be_written_is_one_clear_error(tmp_path):
    done = lira("bench", "twin", "--json", str(tmp_path / "no" / "twin.json"))
    assert done.returncode == 2
    assert done.stderr.startswith("lira bench: cannot write")


def test_the_table_has_a_column_for_every_field():
    done = lira("bench", "twin")
    assert done.stdout.splitlines()[-3:] == [
        "profile     real_time_factor  renderer",
        "thesis-sim              61.2",
        "rosbot2                            egl",
    ]


def test_the_machine_is_described():
    machine = bench.describe_machine()
    assert list(machine) == ["cpu", "cores", "system", "python", "packages", "date"]
    assert machine["cpu"]
    assert machine["cores"] >= 1
    assert machine["packages"]["numpy"]
    json.dumps(machine)


def test_a_processor_without_a_name_still_gets_one(tmp_path):
    (tmp_path / "cpuinfo").write_text("flags: none\n")
    assert bench.cpu_model(tmp_path / "cpuinfo")


def test_every_benchmark_has_its_module():
    assert all(find_spec(bench.module_of(name)) for name in bench.BENCHES)


def test_make_says_which_benchmarks_it_leaves_out():
    makefile = (Path(__file__).parents[3] / "Makefile").read_text()
    made = re.search(r"^BENCHES := (.*)$", makefile, re.MULTILINE)[1].split()
    said = re.search(r"^bench: .*## (.*)$", makefile, re.MULTILINE)[1]
    assert set(made) < set(bench.BENCHES)
    assert re.search(r"all benchmarks but ([\w, ]+?), into", said)[1].replace(" and ", ", ").split(", ") == sorted(
        set(bench.BENCHES) - set(made)
    )


def test_an_unknown_bench_is_refused(capsys):
    assert cli.main(["bench", "nosuch"]) == 2
    assert "twin" in capsys.readouterr().err
