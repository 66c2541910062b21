"""What a trial consists of: the processes under test, and those that look on or mean no good."""
