"""Stack pictures of the main comparison for the README: `python docs/overview.py paper-15`."""

import sys
from pathlib import Path

from PIL import Image

pictures = Path(sys.argv[1], "pictures")
rows = [Image.open(pictures / f"{name}.png").convert("RGB") for name in ("side-by-side", "numbers")]
width = max(row.width for row in rows)
rows = [row.resize((width, round(row.height * width / row.width))) for row in rows]
stacked = Image.new("RGB", (width, sum(row.height for row in rows)), "white")
for k, row in enumerate(rows):
    stacked.paste(row, (0, sum(above.height for above in rows[:k])))
stacked.save(Path(__file__).with_suffix(".png"), optimize=True)
