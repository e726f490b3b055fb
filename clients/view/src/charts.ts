// Curves and histograms.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import type { Histogram } from "./measure";
import type { PastRow } from "./messages";
import { css } from "./page";

const kRules = [
  { key: "size", name: "R1 size", colour: "#2563eb" },
  { key: "radiusEdge", name: "R2 radius / edge", colour: "#0d9488" },
  { key: "sliver", name: "R3 slivers", colour: "#d97706" },
  { key: "inconsistent", name: "R4 inconsistent", colour: "#dc2626" },
] as const;

const short = (n: number) =>
  Math.abs(n) >= 1e6 ? `${n / 1e6}M` : Math.abs(n) >= 1e4 ? `${n / 1e3}k` : `${n}`;

function axis(options: Partial<uPlot.Axis>): uPlot.Axis {
  return {
    stroke: css("--dim"),
    grid: { stroke: css("--line"), width: 1 },
    ticks: { stroke: css("--line"), width: 1, size: 4 },
    font: "11px system-ui, sans-serif",
    gap: 3,
    ...options,
  };
}

// Draws again what has another width, or other colours, than before.
function keepDrawn(host: HTMLElement, draw: () => void) {
  let width = host.clientWidth;
  new ResizeObserver(() => {
    if (host.clientWidth === width) return;
    width = host.clientWidth;
    draw();
  }).observe(host);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}

// Stars that break each rule, one upon the other, over the revisions.
export class Curves {
  private plot: uPlot | null = null;
  private rows: PastRow[] = [];

  constructor(
    private readonly host: HTMLElement,
    legend: HTMLElement,
    private readonly onPick: (revision: number) => void,
  ) {
    for (const rule of kRules) {
      const item = document.createElement("span");
      item.style.setProperty("--swatch", rule.colour);
      item.textContent = rule.name;
      legend.append(item);
    }
    keepDrawn(host, () => this.draw());
  }

  show(rows: PastRow[]) {
    this.rows = rows;
    this.draw();
  }

  private draw() {
    this.plot?.destroy();
    this.plot = null;
    this.host.parentElement!.hidden = this.rows.length === 0;
    const width = this.host.clientWidth;
    if (width === 0 || this.rows.length === 0) return;
    let sum = this.rows.map(() => 0);
    const sums = kRules.map((rule) => (sum = this.rows.map((row, i) => sum[i] + row[rule.key])));
    // The whole first, so that of lines that coincide the one is seen that has something.
    const data = [this.rows.map((row) => row.revision), ...sums.reverse()];
    const rules = [...kRules].reverse();
    const options: uPlot.Options = {
      width,
      height: 150,
      legend: { show: false },
      cursor: { y: false, drag: { x: false, y: false } },
      scales: { x: { time: false }, y: { range: (_, __, high) => [0, Math.max(high, 1)] } },
      axes: [
        axis({ size: 26, values: (_, ticks) => ticks.map((t) => `${t}`) }),
        axis({ size: 40, values: (_, ticks) => ticks.map(short) }),
      ],
      series: [
        {},
        ...rules.map((rule, i) => ({
          stroke: rule.colour,
          width: 1.5,
          points: { show: this.rows.length < 3 },
          ...(i === rules.length - 1 ? { fill: `${rule.colour}40` } : {}),
        })),
      ],
      bands: rules.slice(1).map((_, i) => ({
        series: [i + 1, i + 2] as [number, number],
        fill: `${rules[i].colour}40`,
      })),
    };
    this.plot = new uPlot(options, data as uPlot.AlignedData, this.host);
    this.plot.over.addEventListener("click", () => {
      const at = this.plot?.cursor.idx;
      if (at !== null && at !== undefined) this.onPick(this.rows[at].revision);
    });
  }
}

export class Histograms {
  private histograms: Histogram[] = [];

  constructor(private readonly host: HTMLElement) {
    keepDrawn(host, () => this.draw());
  }

  show(histograms: Histogram[]) {
    this.histograms = histograms;
    this.draw();
  }

  private draw() {
    this.host.replaceChildren();
    this.host.parentElement!.hidden = this.histograms.length === 0;
    this.histograms.forEach((histogram) => this.add(histogram));
  }

  private add({ name, unit, low, high, bins }: Histogram) {
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    caption.textContent = name;
    const place = document.createElement("div");
    figure.append(caption, place);
    this.host.append(figure);
    const width = place.clientWidth;
    if (width === 0) return;
    const step = (high - low) / bins.length;
    const bars = uPlot.paths.bars!({ size: [1, Infinity], align: 1, gap: 1 });
    new uPlot(
      {
        width,
        height: 92,
        legend: { show: false },
        cursor: { show: false },
        scales: { x: { time: false, range: [low, high] }, y: { range: (_, __, top) => [0, top] } },
        axes: [
          axis({ size: 22, values: (_, ticks) => ticks.map((t) => `${t}${unit}`) }),
          axis({ size: 40, values: (_, ticks) => ticks.map(short) }),
        ],
        series: [{}, { paths: bars, fill: css("--accent"), width: 0, points: { show: false } }],
      },
      [bins.map((_, i) => low + i * step), bins] as uPlot.AlignedData,
      place,
    );
  }
}
