"""The thesis's experiments on the twin, in process: many trials, paired by seed, resumable, in parallel."""
