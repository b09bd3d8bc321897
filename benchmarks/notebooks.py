"""The notebooks of docs/notebooks: runs them and keeps what they print and draw.

python benchmarks/notebooks.py            # runs all, and writes their outputs anew
python benchmarks/notebooks.py barrier    # this one
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).parent.parent / "docs" / "notebooks"
LONGEST_S = 300


def run(path: Path) -> nbformat.NotebookNode:
    """The notebook ``path`` with the outputs of a run in an empty folder."""
    notebook = nbformat.read(path, as_version=4)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        NotebookClient(notebook, timeout=LONGEST_S, resources=resources).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", []):
            if "text/html" in output.get("data", {}):
                output.data.pop("image/svg+xml", None)  # it stands in the HTML as well
    notebook.metadata.language_info = {"name": "python"}
    return notebook


def printed(notebook: nbformat.NotebookNode) -> list[str]:
    """What each cell of code prints and shows as text; pictures are left out."""
    return ["".join(map(_text, cell.outputs)) for cell in notebook.cells if "outputs" in cell]


def _text(output: Any) -> str:
    if output.output_type == "stream":
        return str(output.text) if output.name == "stdout" else ""
    return str(output.data["text/plain"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    asked = parser.parse_args().names
    for path in sorted(FOLDER.glob("*.ipynb")):
        if not asked or path.stem in asked:
            started = time.monotonic()
            nbformat.write(run(path), path)
            print(f"{path.name}: {time.monotonic() - started:.0f} s")


if __name__ == "__main__":
    main()
