# %% [markdown]
# # Read a run
# Every run leaves `run.jsonl` (each step) and `labels.lira` (each label). This opens as a notebook with jupytext.

# %%
import sys
from collections import Counter
from pathlib import Path
from tempfile import mkdtemp

import lira

folder = Path(sys.argv[1] if len(sys.argv) > 1 else mkdtemp())  # a run of your own, such as runs/demo-...
if not (folder / "run.jsonl").exists():
    with lira.simulate("lane") as robot:
        lira.teach(robot, "lira", laps=1, unseen=1, folder=folder, say=lambda _: None)
records = list(lira.read_run(folder / "run.jsonl"))

# %% [markdown]
# ## Laps
# %%
for lap in (each for each in records if isinstance(each, lira.LapRecord)):
    print(f"{lap.phase:<7} {'passed' if lap.passed else 'failed'} {lap.duration_s:5.1f} s, {lap.calls} calls so far")

# %% [markdown]
# ## Who drove, and where the robot called
# %%
steps = [each for each in records if isinstance(each, lira.StepRecord)]
print("drivers:", Counter(step.decision.driver for step in steps).most_common())
called = [step.state.progress_m or 0.0 for step in steps if step.state and step.decision.call is lira.Call.FEEDBACK]
print("called for feedback at", sorted({round(progress_m) for progress_m in called}), "m along the line")

# %% [markdown]
# ## Labels: who gave them
# %%
labels = list(lira.read_demonstrations(folder / "labels.lira"))
for source in sorted({label.source for label in labels}):
    mine = [label for label in labels if label.source == source]
    print(f"{source:<6} {len(mine):3} given, {sum(label.stored for label in mine):3} stored")
