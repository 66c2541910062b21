"""Hash the messages of a package as ROS's own generator does: rosidl_hashes.py PACKAGE_FOLDER SHARE; prints JSON.

Runs in the foreign environment. What `colcon build` would do before any compiler: .msg to .idl, then its description.
"""

import json
import pathlib
import sys
import tempfile

from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_generator_type_description import generate_type_hash

package, share = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
name, messages = package.name, sorted(package.glob("msg/*.msg"))
with tempfile.TemporaryDirectory() as folder:
    out = pathlib.Path(folder)
    for message in messages:
        convert_msg_to_idl(package, name, message.relative_to(package), out / "msg")
    arguments = {
        "package_name": name,
        "output_dir": str(out / "described"),
        "idl_tuples": [f"{out}:msg/{message.stem}.idl" for message in messages],
        "include_paths": [f"{each.name}:{each}" for each in share.iterdir() if (each / "msg").is_dir()],
    }
    (out / "arguments.json").write_text(json.dumps(arguments))
    generate_type_hash(str(out / "arguments.json"))
    found = {}
    for message in messages:
        told = json.loads((out / "described" / "msg" / f"{message.stem}.json").read_text())
        found |= {each["type_name"]: each["hash_string"] for each in told["type_hashes"]}
print(json.dumps(found))
