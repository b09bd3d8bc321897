"""A job whose files a test wrote or changed, with the sums of its manifest taken anew."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

JOB_ENDINGS = (".nc", ".plt", ".svg", ".fold", ".toml", ".pdf", ".json")


def seal(folder: Path) -> None:
    """Write the sums of the files in ``folder`` into its manifest, which is made if need be."""
    path = folder / "manifest.json"
    empty = {"schema": "miurafab-job/1", "tool": "a test", "options": {}, "profiles": {}}
    document = json.loads(path.read_text()) if path.is_file() else empty
    document["files"] = {
        each.name: hashlib.sha256(each.read_bytes()).hexdigest()
        for each in sorted(folder.iterdir())
        if each.suffix in JOB_ENDINGS and each != path
    }
    path.write_text(json.dumps(document))
