"""LIRA-SPF: experts, novice, algorithm, trainer and the service that drives a robot with them."""
