"""Emulators of the ROSbot's devices: the real wire protocols over pseudo-terminals and HTTP, fed by the twin.

They share no code with the drivers in `robot/`: what both sides got wrong would go unnoticed.
"""
