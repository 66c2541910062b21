"""The scripted teacher, and the course of a session with it."""
