"""Worlds by name: those that come with the project, or a user's own by the path of its file."""

from importlib import resources
from pathlib import Path

import msgspec

from lira.hal.config import load_toml
from lira.hal.errors import ConfigError
from lira.sim_backend.layout import check
from lira.sim_backend.world import World


def known_worlds() -> list[str]:
    """Names of the worlds that come with the project."""
    folder = resources.files("lira.sim_backend") / "worlds"
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_world(name_or_path: str) -> World:
    """Load a world by name, or a user's own by the path of its TOML file.

    Raises `ConfigError` for an unknown name, an unknown key, a value out of range, a line that does not close,
    a box on the start or a mesh that is not there.
    """
    if name_or_path.endswith(".toml"):
        path = Path(name_or_path)
    elif name_or_path in known_worlds():
        path = Path(str(resources.files("lira.sim_backend") / "worlds" / f"{name_or_path}.toml"))
    else:
        raise ConfigError(
            f"unknown world '{name_or_path}'",
            f"Known worlds: {', '.join(known_worlds())}; or give the path of a .toml file.",
        )
    world = load_toml(path, World)
    meshes = tuple(msgspec.structs.replace(mesh, path=str((path.parent / mesh.path).resolve())) for mesh in world.mesh)
    world = msgspec.structs.replace(world, name=path.stem, mesh=meshes)
    try:
        check(world)
    except ValueError as error:
        raise ConfigError(f"{path}: {error}", "Mend the world file.") from error
    for mesh in meshes:
        if not Path(mesh.path).is_file():
            raise ConfigError(f"{path}: there is no mesh {mesh.path}", "A mesh's path is from the world's file.")
    return world
