"""A learning method of your own: the novice drives, and calls a human where it is far from every expert.

From a shell: lira demo --method examples/03_my_method.py:Settings, or in a table beside the others:
lira experiment table2 --method examples/03_my_method.py:Settings
"""

import lira


class FarFromAll(lira.Method):
    """What is learned is what the human does; that is `Method.learn` as it is. Only `propose` is new."""

    def __init__(self, context: lira.Context, far: float) -> None:
        self.experts, self.far = context.experts, far
        self.novice = context.novice(m=10)  # the networks; a training step after every 10 labels

    def propose(self, features: lira.Features) -> lira.Proposal:
        """Decide as if no human were there."""
        a_n = self.novice.act(features)
        away = min(abs(a_n[1] - expert.act(features)[1]) for expert in self.experts)
        own = lira.Choice(lira.Driver.NOVICE, a_n, call=lira.Call.FEEDBACK if away > self.far else lira.Call.NONE)
        choice = own if self.novice.trained else lira.Choice(lira.Driver.NOBODY, (0.0, 0.0))
        return lira.Proposal(features, choice, a_n, speed=0.3 if away > self.far else 1.0)


class Settings(lira.MethodSettings, frozen=True):
    """Plain values, and what is built from them."""

    far: float = 0.5  # of an action's range of 2

    def build(self, context: lira.Context) -> lira.Method:
        """Build the method for one run."""
        return FarFromAll(context, self.far)


if __name__ == "__main__":
    with lira.simulate("lane") as robot:
        taught = lira.teach(robot, Settings(far=0.4), teacher="perfect", laps=2, unseen=1)
    print("human labels", taught.result.human_labels, "calls", taught.result.calls, "converged", taught.converged)
