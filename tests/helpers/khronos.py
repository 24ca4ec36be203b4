"""The Khronos validator of glTF files."""

from npm import needs, told

VALIDATE = """
const validator = require(process.argv[1]);
const read = require("fs").readFileSync;
const check = async (file) => (await validator.validateBytes(new Uint8Array(read(file)))).issues;
Promise.all(process.argv.slice(2).map(check)).then((all) => console.log(JSON.stringify(all)));
"""

needs_validator = needs("gltf-validator")


def faults(*files):
    """What the validator objects to in files, as errors or warnings: its messages in words."""
    return [
        f"{file}: {message['message']} at {message.get('pointer')}"
        for file, issues in zip(files, told("gltf-validator", VALIDATE, files), strict=True)
        for message in issues["messages"]
        if message["severity"] < 2
    ]
