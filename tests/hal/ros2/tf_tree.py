"""Transforms as tf2's buffer takes them: each frame one parent, no loops, stamps that do not run back."""

import numpy as np


class TfBuffer:
    """Takes tf2_msgs/TFMessage; refuses with `AssertionError` what tf2 would refuse or warn of."""

    def __init__(self):
        self._parents = {}
        self._static = {}
        self._stamps_ns = {}
        self._matrices = {}

    def add(self, message, *, static=False):
        for each in message.transforms:
            parent, child = each.header.frame_id, each.child_frame_id
            stamp_ns = each.header.stamp.sec * 10**9 + each.header.stamp.nanosec
            assert parent, "TF_NO_FRAME_ID"
            assert child, "TF_NO_CHILD_FRAME_ID"
            assert parent != child, "TF_SELF_TRANSFORM"
            assert not parent.startswith("/"), "tf2 takes no leading slash"
            assert not child.startswith("/"), "tf2 takes no leading slash"
            assert self._parents.get(child, parent) == parent, f"{child} changes its parent: the tree breaks"
            assert self._static.get(child, static) == static, f"{child} is both static and not"
            if not static:
                assert stamp_ns > self._stamps_ns.get(child, -1), "TF_OLD_DATA or TF_REPEATED_DATA"
            self._parents[child], self._static[child], self._stamps_ns[child] = parent, static, stamp_ns
            self._matrices[child] = matrix_of(each.transform)

    def frames(self):
        return {*self._parents, *self._parents.values()}

    def roots(self):
        """Where one gets to from each frame; a loop would never end, so it is an error."""
        found = set()
        for frame in self._parents:
            above, seen = frame, {frame}
            while above in self._parents:
                above = self._parents[above]
                assert above not in seen, f"a loop through {above}"
                seen.add(above)
            found.add(above)
        return found

    def transform(self, target, source, point):
        """Return a point of the frame `source` in the frame `target` above it."""
        vector = np.array([*point, 1.0])
        while source != target:
            vector = self._matrices[source] @ vector
            source = self._parents[source]
        return tuple(vector[:3])


def matrix_of(transform):
    at, q = transform.translation, transform.rotation
    x, y, z, w = q.x, q.y, q.z, q.w
    assert abs(x * x + y * y + z * z + w * w - 1.0) < 1e-3, "TF_DENORMALIZED_QUATERNION"
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), at.x],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), at.y],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), at.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
