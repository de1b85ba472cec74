"""Gallery scripts save their picture in the current folder; this moves it into the built pages."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any


def move_pictures(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Move the pictures a block of a script has written, and give the markup that shows them."""
    from sphinx_gallery.scrapers import figure_rst

    source = Path(block_vars["src_file"])
    moved = []
    for picture in sorted({*source.parent.glob(f"{source.stem}*.png"), *Path.cwd().glob(f"{source.stem}*.png")}):
        target = next(block_vars["image_path_iterator"])
        shutil.move(picture, target)
        moved.append(target)
    return figure_rst(moved, gallery_conf["src_dir"])


def _get_sg_image_scraper() -> Any:
    return move_pictures
