"""The Khronos validator of glTF files, from npm; scripts/test installs it into .node."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

VALIDATOR = Path(__file__).parents[2] / ".node" / "node_modules" / "gltf-validator"

VALIDATE = """
const validator = require(process.argv[1]);
const read = require("fs").readFileSync;
const check = async (file) => (await validator.validateBytes(new Uint8Array(read(file)))).issues;
Promise.all(process.argv.slice(2).map(check)).then((all) => console.log(JSON.stringify(all)));
"""

needs_validator = pytest.mark.skipif(
    shutil.which("node") is None or not VALIDATOR.is_dir(),
    reason="node or gltf-validator is not installed: scripts/test does it where npm is",
)


def faults(*files):
    """What the validator objects to in files, as errors or warnings: its messages in words."""
    done = subprocess.run(
        ["node", "-e", VALIDATE, str(VALIDATOR), *map(str, files)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return [
        f"{file}: {message['message']} at {message.get('pointer')}"
        for file, issues in zip(files, json.loads(done.stdout), strict=True)
        for message in issues["messages"]
        if message["severity"] < 2
    ]
