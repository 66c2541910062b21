"""Hashes a package of messages with ROS 2's own generators: its folder in, JSON of hashes by type out."""

import json
import os
import sys
import tempfile
from pathlib import Path

from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_generator_type_description import generate_type_hash

package, share = Path(sys.argv[1]).absolute(), Path(os.environ["AMENT_PREFIX_PATH"]) / "share"
name = package.name
with tempfile.TemporaryDirectory() as folder:
    idl, out = Path(folder) / "idl", Path(folder) / "out"
    idl.mkdir()
    files = [
        convert_msg_to_idl(package, name, file.relative_to(package), idl) for file in sorted(package.glob("msg/*"))
    ]
    arguments = {
        "package_name": name,
        "output_dir": str(out),
        "idl_tuples": [f"{idl}:{Path(file).name}" for file in files],
        "include_paths": [f"{each.name}:{each}" for each in share.iterdir() if each.is_dir()],
    }
    told = Path(folder) / "arguments.json"
    told.write_text(json.dumps(arguments))
    sys.stdout, stdout = sys.stderr, sys.stdout
    generated = generate_type_hash(str(told))
    hashes = [each for file in generated for each in json.loads(Path(file).read_text())["type_hashes"]]
    print(json.dumps({each["type_name"]: each["hash_string"] for each in hashes}), file=stdout)
