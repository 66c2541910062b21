"""A view to look at without a robot: what the twin sees, with a decision made up. For the picture in the README."""

import math

from lira.hal.messages import (
    Applied,
    BatteryState,
    Call,
    Decision,
    Driver,
    Episode,
    ExpertView,
    Image,
    LabelCounts,
    OperatorAnswer,
    Reason,
    Source,
    Twist,
)
from lira.hal.messages.compression import compress
from lira.hal.profile import load_profile
from lira.tools.operator.view import View

START_M = 14.0


def sample_view() -> View:
    """A robot on a line with boxes, at a moment when its experts disagree."""
    from lira.sim_backend.catalogue import load_world
    from lira.sim_backend.twin import Twin

    profile = load_profile("thesis-sim")
    twin = Twin(profile, load_world("line-obstacles"), renderer="tiny")
    twin.open()
    try:
        twin.reset(Episode(start_m=START_M))
        twin.wait(twin.now() + 0.3)
        seen, truth = twin.read(), twin.state()
    finally:
        twin.close()
    assert seen.image is not None
    picture = compress(seen.image, "png") if isinstance(seen.image, Image) else seen.image
    experts = (
        ExpertView("camera", (0.86, 0.42), 0.161, True),
        ExpertView("lidar", (0.71, -0.65), 0.118, True),
    )
    counts = LabelCounts(stored_human=38, stored_expert=71, demonstration=30)
    decision = Decision(
        seen.stamp_s,
        seen.seq,
        Driver.NOVICE,
        Call.FEEDBACK,
        (0.62, -0.18),
        (0.62, -0.18),
        None,
        experts,
        0.06,
        counts,
        4,
        5,
        9,
    )
    twist = Twist(0.19, -0.05)
    return View(
        robot="rosbot",
        scan=seen.scan,
        scan_age_s=0.05,
        picture=picture,
        picture_age_s=0.04,
        odom=seen.odom,
        truth=truth,
        truth_age_s=0.05,
        applied=Applied(twist, seen.stamp_s, Source.POLICY, Reason.OK),
        link_age_s=0.012,
        decision=decision,
        decision_age_s=0.1,
        battery=BatteryState(seen.stamp_s, 11.9),
        answer=OperatorAnswer(seen.stamp_s, count=1, words="saved 139 labels and the novice after 4 training steps"),
        answer_age_s=0.1,
        verdict_age_s=0.1,
        fov_rad=min(profile.features.fov_rad, 2 * math.pi),
        max_range_m=profile.features.max_range_m,
    )
