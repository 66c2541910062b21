"""Drive a simulated robot: with an expert that comes with the project, and with a policy of your own."""

import lira


def careful(seen: lira.Features) -> tuple[float, float]:
    """Stop before what is ahead; `scan` is 1 where the way is free, and an action is in [-1, 1]^2."""
    return max(0.0, 2.0 * float(seen.scan.min()) - 0.2), 0.0


def main() -> None:
    """Drive both for ten seconds. A robot on the bus is driven the same way: `with lira.connect("rosbot:7447")`."""
    for policy in ("camera-expert", careful):
        with lira.simulate("line-obstacles") as robot:
            for step in lira.drive(robot, policy, steps=50):
                state = step.state
                assert state is not None  # ground truth, which only a twin knows
                if step.observation.seq % 10 == 0 or state.collided:
                    applied = step.applied.twist  # what the robot really did, clamped by its governor
                    print(
                        f"{step.proposal.choice.driver}: {state.progress_m:.2f} m along the line, "
                        f"{applied.linear_m_s:.2f} m/s, the nearest box {state.clearance_m:.2f} m away"
                    )
                if state.collided:
                    print("it hit a box")
                    break


if __name__ == "__main__":
    main()
