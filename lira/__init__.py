"""Teach a mobile robot by interaction: single-sensor experts and a person train a fused policy (LIRA-SPF)."""
