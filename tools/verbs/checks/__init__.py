"""Verbs that find faults and measure."""
