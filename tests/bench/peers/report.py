"""The table and the plot of a comparison."""

from __future__ import annotations

import csv
import math
import subprocess
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from suite import Case

BEGIN = "<!-- begin: tests/bench/run peers --update-docs -->"
END = "<!-- end -->"


@dataclass(frozen=True)
class Row:
    """One measured mesh. Times in seconds of processor time, memory in bytes."""

    manifold: str
    mesher: str
    matched: str  # "" for a peer; what Stellate was matched in: "vertices" or "error"
    size: float
    vertices: int
    seconds: float
    vertices_per_second: float
    times_faster: float  # than the peer, 0 for the peer itself: see rows_of
    times_faster_uncertified: float  # likewise, the certificate left out
    certificate_share: float  # of the seconds
    oracle_share: float  # of the seconds, where it can be told apart
    evaluations_per_vertex: float
    bytes_per_vertex: float
    min_angle_degrees: float  # k = 2, else 0
    min_fatness: float
    hausdorff: float
    closed: bool
    note: str

    def quality(self) -> str:
        """The worst angle of a surface, the worst fatness of a solid."""
        if self.min_angle_degrees > 0.1:
            return f"{self.min_angle_degrees:.0f}°"
        if self.min_angle_degrees > 0:
            return f"{self.min_angle_degrees:.1g}°"
        return f"{self.min_fatness:.1g}"

    def name(self) -> str:
        """The mesher, and what it was matched in."""
        return f"{self.mesher}, same {self.matched}" if self.matched else self.mesher

    def summary(self) -> str:
        """One line for the terminal."""
        faster = f", {self.times_faster:.1f} times as fast" if self.matched else ""
        return (
            f"{self.name()}: {self.vertices} vertices in {self.seconds:.2f} s, "
            f"{self.vertices_per_second:.0f} vertices/s{faster}, error {self.hausdorff:.2g}"
        )


def rows_of(
    case: Case, peer: dict[str, Any], same_count: dict[str, Any], same_error: dict[str, Any]
) -> list[Row]:
    """The rows of one case.

    At the same number of vertices, which is met to some per cent, `times_faster` compares vertices
    a second; at the same error it compares the time that the whole mesh takes.
    """

    def row(mesher: str, matched: str, result: dict[str, Any]) -> Row:
        n, seconds = result["vertices"], result["seconds"]
        bare = seconds - result["certificate_seconds"]
        scale = n / peer["vertices"] if matched == "vertices" else 1.0
        return Row(
            manifold=case.title,
            mesher=mesher,
            matched=matched,
            size=result["size"],
            vertices=n,
            seconds=seconds,
            vertices_per_second=n / seconds,
            times_faster=scale * peer["seconds"] / seconds if matched else 0.0,
            times_faster_uncertified=scale * peer["seconds"] / bare if matched else 0.0,
            certificate_share=result["certificate_seconds"] / seconds,
            oracle_share=result["oracle_seconds"] / seconds,
            evaluations_per_vertex=result["evaluations"] / n,
            bytes_per_vertex=result["peak_bytes"] / n,
            min_angle_degrees=result["min_angle_degrees"],
            min_fatness=result["min_fatness"],
            hausdorff=result["hausdorff"],
            closed=result["closed"],
            note=result["note"],
        )

    return [
        row(case.peer.name, "", peer),
        row(case.ours.name, "vertices", same_count),
        row(case.ours.name, "error", same_error),
    ]


def count(value: float) -> str:
    """A number for people: three digits, thousands apart."""
    if value >= 1000:
        digits = len(str(int(value))) - 3
        return f"{round(value, -digits):,.0f}"
    return f"{value:.3g}"


def ratio(value: float) -> str:
    """Two digits."""
    return f"{value:.2g}" if value < 100 else f"{value:.0f}"


def markdown(rows: list[Row]) -> str:
    """The table."""
    lines = [
        "| Manifold | Mesher | Vertices | CPU s | Vertices/s | × | × bare | Evaluations/vertex "
        "| Bytes/vertex | Worst | Hausdorff | Closed |",
        "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|---|",
    ]
    for row in rows:
        closed = "yes" if row.closed else "**no**"
        if row.matched:
            closed += ", certified" if row.note == "certified" else ", **not certified**"
        lines.append(
            "| "
            + " | ".join(
                [
                    "" if row.matched else row.manifold,
                    row.name(),
                    f"{row.vertices:,}",
                    f"{row.seconds:.3g}",
                    count(row.vertices_per_second),
                    f"**{ratio(row.times_faster)}**" if row.matched else "",
                    ratio(row.times_faster_uncertified) if row.matched else "",
                    count(row.evaluations_per_vertex),
                    count(row.bytes_per_vertex),
                    row.quality(),
                    f"{row.hausdorff:.2g}",
                    closed,
                ]
            )
            + " |"
        )
    return "\n".join(lines) + "\n"


def provenance() -> str:
    """Where and of what it was measured."""
    model = "unknown processor"
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            model = line.split(":", 1)[1].strip()
            break
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    ).stdout.strip()
    packages = subprocess.run(
        ["dpkg-query", "-W", "-f", "${Package} ${Version}, ", "libcgal-dev", "libgudhi-dev"],
        capture_output=True,
        text=True,
        check=False,
    ).stdout.strip(", ")
    return f"{model}, one thread; commit {commit or 'unknown'}; {packages}."


def write(directory: Path, rows: list[Row], update_docs: bool) -> None:
    """Writes table.md, table.csv and plot.png, and the documentation's copy if asked."""
    directory.mkdir(parents=True, exist_ok=True)
    table = f"{provenance()}\n\n{markdown(rows)}"
    (directory / "table.md").write_text(table, encoding="utf-8")
    with (directory / "table.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(asdict(rows[0])))
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    plot(directory / "plot.png", rows)
    if update_docs:
        docs = Path(__file__).resolve().parents[3] / "docs" / "evidence"
        page = docs / "benchmarks.md"
        text = page.read_text(encoding="utf-8")
        head, rest = text.split(BEGIN, 1)
        tail = rest.split(END, 1)[1]
        page.write_text(f"{head}{BEGIN}\n{table}{END}{tail}", encoding="utf-8")
        plot(docs / "benchmarks.png", rows)


def plot(path: Path, rows: list[Row]) -> None:
    """Speed, questions and memory at the same number of vertices, as bars."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    peers = [row for row in rows if not row.matched]
    ours = [row for row in rows if row.matched == "vertices"]
    labels = [
        f"{row.manifold}, {row.vertices / 1000:.0f}k\n{row.mesher.replace(', ', chr(10))}"
        for row in peers
    ]
    panels = (
        ("vertices per second of processor time", "vertices_per_second"),
        ("oracle evaluations per vertex", "evaluations_per_vertex"),
        ("peak memory, bytes per vertex", "bytes_per_vertex"),
    )
    height = 0.38
    figure, axes = pyplot.subplots(
        1, 3, figsize=(13, 1.2 + 0.55 * len(peers)), sharey=True, layout="constrained"
    )
    for axis, (title, key) in zip(axes, panels):
        for row_set, shift, colour, label in (
            (peers, -height / 2, "#b8b0a2", "peer"),
            (ours, height / 2, "#1f6f8b", "Stellate, same number of vertices"),
        ):
            values = [getattr(row, key) for row in row_set]
            bars = axis.barh(
                [i + shift for i in range(len(values))], values, height, color=colour, label=label
            )
            axis.bar_label(bars, [count(value) for value in values], padding=2, fontsize=7)
        # Bars on a scale of powers have no natural beginning: a power of ten, the same for all.
        values = [getattr(row, key) for row in rows]
        axis.set_xscale("log")
        axis.set_xlim(10 ** math.floor(math.log10(min(values) / 2)), 3 * max(values))
        axis.set_title(title, fontsize=10)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_yticks(range(len(labels)), labels, fontsize=7)
    axes[0].invert_yaxis()
    axes[1].legend(loc="upper center", bbox_to_anchor=(0.5, -0.06), ncols=2, frameon=False)
    figure.savefig(path, dpi=130)
    pyplot.close(figure)
