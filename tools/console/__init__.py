"""The console: what the robot sees, who drives and why, on one screen. It only looks; a slow console slows nobody.

`state` folds what comes over the bus, `draw` and `palette` turn it into pictures, `sound` makes the two
calls, `keyboard` is the fallback for a pad; the loop is the verb.
"""
