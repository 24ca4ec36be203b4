"""The Khronos validator of glTF files, which scripts/test installs into .node with npm."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

MODULES = Path(__file__).parents[2] / ".node" / "node_modules"

VALIDATE = """
const validator = require(process.argv[1]);
const read = require("fs").readFileSync;
const check = async (file) => (await validator.validateBytes(new Uint8Array(read(file)))).issues;
Promise.all(process.argv.slice(2).map(check)).then((all) => console.log(JSON.stringify(all)));
"""


def missing():
    """Why files cannot be validated here; empty where they can."""
    if shutil.which("node") is None:
        return "node is not installed"
    if not (MODULES / "gltf-validator").is_dir():
        return "gltf-validator is not installed: scripts/test does it where npm is"
    return ""


needs_validator = pytest.mark.skipif(bool(missing()), reason=missing() or "none")


def faults(*files):
    """What the validator objects to in files, as errors or warnings: its messages in words."""
    module = str(MODULES / "gltf-validator")
    done = subprocess.run(
        ["node", "-e", VALIDATE, module, *map(str, files)],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert len(told) == len(files)
    return [
        f"{file}: {message['message']} at {message.get('pointer')}"
        for file, issues in zip(files, told, strict=True)
        for message in issues["messages"]
        if message["severity"] < 2
    ]
