"""Draw a world: from above, and as the robot's camera sees it at a few places along the way.

examples:
  lira world passage --picture passage.png             the floor, and what the camera makes of it
  lira world race --layout 7 --picture race.png        another layout of its boxes
  lira world my-track.toml --profile rosbot2 --picture my-track.png
"""

import argparse
from pathlib import Path

from lira.tools.options import add_layout, add_profile


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("name", help="world by name or .toml file")
    add_layout(parser, "which layout of its boxes")
    add_profile(parser, "thesis-sim", "whose camera looks: a robot")
    parser.add_argument("--picture", required=True, type=Path, metavar="FILE.png", help="where to write the picture")


def run(args: argparse.Namespace) -> int:
    """Draw, and say where the picture is."""
    from lira.hal.errors import ConfigError
    from lira.hal.profile import load_profile
    from lira.sim_backend.catalogue import load_world
    from lira.sim_backend.layout import build

    picture: Path = args.picture
    if picture.suffix.lower() != ".png":
        raise ConfigError(f"{picture} is no .png file", "Name the picture FILE.png.")
    profile, layout = load_profile(args.profile), build(load_world(args.name), args.layout)

    import cv2

    from lira.tools.output.world_picture import draw

    _, data = cv2.imencode(".png", draw(layout, profile), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    try:
        picture.write_bytes(data.tobytes())
    except OSError as error:
        raise ConfigError(f"cannot write {picture}: {error.strerror}", "Choose a folder that is there.") from error
    print(f"wrote {picture}: world '{layout.world.name}', layout {layout.seed}, seen by {profile.name}")
    return 0
