"""Vertices a second beside the peers, as the table of docs/evidence/benchmarks.md has them."""

from __future__ import annotations

import _drawing as drawing
import matplotlib.pyplot as plt

SHOWN = ("S² in R³", "torus in R³", "T² in R⁴", "S³ in R⁴", "SO(3) in R⁹", "S² in R⁸")
page = drawing.HERE.parents[0] / "evidence" / "benchmarks.md"
rows = [
    [cell.strip() for cell in line.split("|")[1:-1]]
    for line in page.read_text().splitlines()
    if line.startswith("| ") and " in R" in line or line.startswith("|  | Stellate")
]
peers, ours, names = [], [], []
for peer, same in zip(rows, rows[1:]):
    if peer[0] in SHOWN and same[1] == "Stellate, same vertices":
        name = f"{peer[0]}\n{peer[1].split(',')[0]}"
        if name not in names:  # the first of each: some ten thousand vertices
            names.append(name)
            peers.append(float(peer[4].replace(",", "")))
            ours.append(float(same[4].replace(",", "")))

figure, axes = plt.subplots(figsize=(8, 3.4), layout="constrained")
places = range(len(names))
for values, offset, colour, label in (
    (peers, 0.2, drawing.SAND, "peer"),
    (ours, -0.2, drawing.BLUE, "Stellate, same number of vertices, certificate included"),
):
    bars = axes.barh([-p + offset for p in places], values, 0.4, color=colour, label=label)
    axes.bar_label(bars, [f"{value:,.0f}" for value in values], padding=3, fontsize=8)
axes.set_yticks([-p for p in places], names, fontsize=8)
axes.set_xscale("log")
axes.set_xlabel("vertices a second, one thread")
axes.spines[["top", "right"]].set_visible(False)
axes.margins(x=0.12)
axes.legend(loc="lower center", bbox_to_anchor=(0.45, 1), ncols=2, frameon=False, fontsize=8)
drawing.save(figure, "peers")
