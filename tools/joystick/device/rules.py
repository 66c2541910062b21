"""The udev rule that lets the person at this machine, and group input, read pads and their motion sensors."""

from importlib import resources

PLACE = "/etc/udev/rules.d/60-lira-pad.rules"
REMEDY = (
    f"Install the rule: lira joystick --rules | sudo tee {PLACE}, then plug it in again; "
    "or join the group: sudo usermod -aG input $USER, then log in again."
)


def rules_text() -> str:
    """The rule's file."""
    return (resources.files("lira.tools.joystick.device") / "60-lira-pad.rules").read_text(encoding="utf-8")
