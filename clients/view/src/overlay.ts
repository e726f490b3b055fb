// What stands over the picture and goes with it when it is saved: the coordinates' axes, a length, and
// what the colours say.
import { coordinateName } from "./choices";
import type { Scale } from "./look";
import { kMap, type Sight } from "./scene";

const kSvg = "http://www.w3.org/2000/svg";
const kArrow = 34; // pixels
const kLeast = 0.15; // of its length: an axis seen shorter has no name, with others of many
const kLeastOfMany = 0.4;
const kMostAxes = 12;
const kBar = { width: 12, height: 150, right: 74 };

interface Colours {
  text: string;
  line: string;
  ground: string;
}

export interface Legend {
  name: string; // of what is coloured by
  scale: Scale | null;
  scaled: boolean; // lengths are of coordinates divided by their axes' units
}

// A text with a rim of the background's colour, that is read on any mesh.
const word = (place: Record<string, string | number>, text: string, ground: string) =>
  mark("text", { ...place, stroke: ground, "stroke-width": 3, "paint-order": "stroke" }, text);

function mark(tag: string, attributes: Record<string, string | number>, text = ""): SVGElement {
  const made = document.createElementNS(kSvg, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, `${value}`);
  if (text) made.textContent = text;
  return made;
}

// To the third digit of what lies between the ends.
function short(x: number, { low, high }: Scale): string {
  const step = 10 ** (Math.floor(Math.log10(high - low || Math.abs(high) || 1)) - 2);
  const rounded = Number((Math.round(x / step) * step || 0).toPrecision(6));
  return Math.abs(rounded) >= 1e5 || step < 1e-5 ? rounded.toExponential(2) : `${rounded}`;
}

// 1, 2 or 5 times a power of ten, at most that much.
export function roundLength(most: number): number {
  const power = 10 ** Math.floor(Math.log10(most));
  const first = [5, 2, 1].find((f) => f * power <= most * (1 + 1e-12)) ?? 1;
  return Number((first * power).toPrecision(1));
}

export class Overlay {
  private frame: number[] = [];
  private legend: Legend = { name: "", scale: null, scaled: false };

  constructor(
    private readonly svg: SVGSVGElement,
    private readonly colours: () => Colours,
  ) {
    svg.setAttribute("xmlns", kSvg);
  }

  show(frame: number[], legend: Legend) {
    this.frame = frame;
    this.legend = legend;
  }

  draw(sight: Sight) {
    const { width, height } = sight;
    const colours = this.colours();
    this.svg.setAttribute("width", `${width}`);
    this.svg.setAttribute("height", `${height}`);
    this.svg.setAttribute("font-family", "system-ui, 'DejaVu Sans', sans-serif");
    this.svg.setAttribute("font-size", "12");
    this.svg.setAttribute("fill", colours.text);
    const groups = sight.empty ? [] : [this.axes(sight, colours), this.length(sight, colours)];
    const bar = sight.empty ? null : this.bar(sight, colours);
    this.svg.replaceChildren(...groups, ...(bar ? [bar] : []));
  }

  // Coordinates as they lie in the picture, the more so the longer their arrow.
  private axes({ right, up, bottom }: Sight, { line, ground }: Colours): SVGElement {
    const group = mark("g", {
      class: "axes",
      role: "img",
      "aria-label": "axes of the coordinates",
    });
    const [x, y] = [54, bottom - 54];
    const d = this.frame.length / 3;
    const named = Array.from({ length: d }, (_, i) => {
      const at = [0, 1, 2].map((row) => this.frame[row * d + i]);
      const along = (of: [number, number, number]) => at.reduce((sum, a, j) => sum + a * of[j], 0);
      return { name: coordinateName(i), dx: along(right), dy: -along(up), all: Math.hypot(...at) };
    })
      .filter(({ all }) => all > kLeast)
      .sort((a, b) => b.all - a.all)
      .slice(0, kMostAxes);
    for (const { name, dx, dy } of named) {
      const [tx, ty] = [x + kArrow * dx, y + kArrow * dy];
      group.append(mark("line", { x1: x, y1: y, x2: tx, y2: ty, stroke: line, "stroke-width": 2 }));
      if (Math.hypot(dx, dy) < (named.length > 3 ? kLeastOfMany : kLeast)) continue;
      const place = { x: x + (kArrow + 12) * dx, y: y + (kArrow + 12) * dy + 4 };
      group.append(word({ ...place, "text-anchor": "middle" }, name, ground));
    }
    return group;
  }

  // How long something in the middle of the picture is.
  private length({ pixels, bottom }: Sight, { line, ground }: Colours): SVGElement {
    const length = roundLength(130 / pixels);
    const [x, y, w] = [120, bottom - 26, length * pixels];
    const said = this.legend.scaled ? `${length} of x / scale` : `${length}`;
    const group = mark("g", { class: "length", role: "img", "aria-label": `length ${said}` });
    const path = `M${x} ${y - 4}v8M${x} ${y}h${w}M${x + w} ${y - 4}v8`;
    group.append(
      mark("path", { d: path, stroke: line, "stroke-width": 2, fill: "none" }),
      word({ x: x + w / 2, y: y - 8, "text-anchor": "middle" }, said, ground),
    );
    return group;
  }

  private bar({ width, bottom }: Sight, { line, ground }: Colours): SVGElement | null {
    const { name, scale } = this.legend;
    if (scale === null) return null;
    const { low, high } = scale;
    const label = `${name}, ${short(low, scale)} to ${short(high, scale)}`;
    const group = mark("g", { class: "bar", role: "img", "aria-label": label });
    const [x, y] = [width - kBar.right, Math.max((bottom - kBar.height) / 2, 60)];
    const gradient = mark("linearGradient", { id: "map", x1: 0, x2: 0, y1: 1, y2: 0 });
    kMap.forEach((colour, i) =>
      gradient.append(
        mark("stop", { offset: i / (kMap.length - 1), "stop-color": `#${colour.getHexString()}` }),
      ),
    );
    const box = { x, y, width: kBar.width, height: kBar.height };
    group.append(gradient, mark("rect", { ...box, fill: "url(#map)", stroke: line }));
    for (const share of [0, 0.5, 1]) {
      const at = y + (1 - share) * kBar.height;
      const value = low + share * (high - low);
      group.append(
        mark("line", { x1: x + kBar.width, y1: at, x2: x + kBar.width + 4, y2: at, stroke: line }),
        word({ x: x + kBar.width + 7, y: at + 4 }, short(value, scale), ground),
      );
    }
    group.append(word({ x: width - 14, y: y - 12, "text-anchor": "end" }, name, ground));
    return group;
  }
}
