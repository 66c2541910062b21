"""A recorded run as a dataset of others: LeRobot, robomimic, CSV; and theirs as demonstrations for a learner here."""
