"""Contact sheets of every clip of the built-in performer, into docs/: a row a clip.

python benchmarks/performer_sheets.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kumite import performer
from kumite.export.sheet import contact_sheet

COLUMNS = 12
FOLDER = Path(__file__).parents[1] / "docs"


def main() -> None:
    for style in performer.STYLES:
        performance = performer.perform(style, mirrored=False)
        root, wxyz, labels = [], [], []
        for clip, truth in zip(performance.clips, performance.truth):
            # From the first target, or else the first move that is no rest, a quarter second apart.
            moved = [a for a in truth.actions if a.kind != "idle"]
            first = next((a.start for a in [*(a for a in moved if a.mark is not None), *moved]), 0)
            frames = np.minimum(first + np.arange(COLUMNS) * 15, len(clip) - 1)
            root.append(clip.root_position[frames])
            wxyz.append(clip.wxyz[frames])
            labels += [f"{clip.name} {f / clip.fps:.2f}" for f in frames]
        path = FOLDER / f"performer-{style}.png"
        contact_sheet(
            path,
            performance.clips[0].skeleton,
            np.concatenate(root)[:, None],
            np.concatenate(wxyz)[:, None],
            list(range(len(labels))),
            columns=COLUMNS,
            size=(110, 140),
            labels=labels,
        )
        print(f"wrote {path}")


if __name__ == "__main__":
    main()
