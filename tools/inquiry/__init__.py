"""Questions to a recording: is it the same when it is gone through again, what would have been otherwise, and why."""
