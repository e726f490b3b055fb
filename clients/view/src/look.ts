// What is to be seen of a mesh: by which axes, which part, coloured by what.

export type Part = "whole" | "slice" | "cut" | "below" | "boundary";
export type Colour =
  "plain" | "order" | "coordinate" | "size" | "shape" | "wall" | "region" | "place";

export interface Look {
  frame: number[]; // 3 x d, orthonormal rows: what is right, up and near
  part: Part;
  axis: number; // of the slice: a coordinate
  level: number; // 0..1 between the mesh's ends along it
  colour: Colour;
  colourAxis: number;
}

// What a value says: 0..1 on the colour map, or the number of a wall, a region or a place.
export type Palette = "map" | "wall" | "region" | "place";

export interface Shape {
  kind: "triangles" | "segments";
  positions: Float32Array; // 3 a vertex
  values: Float32Array; // of each vertex, as the palette says; NaN: plain
  palette: Palette;
  index: Uint32Array | null;
  cells: ArrayLike<number> | null; // of each triangle or segment, the simplex; null: in their order
}

// What the colour map says from end to end.
export interface Scale {
  low: number;
  high: number;
}

// Where a mesh with boundary ends: curves by wall, and corners.
export interface Rim {
  segments: Float32Array; // pairs of positions
  walls: Uint8Array; // of each segment, as of boundary.ts
  points: Float32Array;
  pointWalls: Uint8Array; // of each point
}

// Vertices in no simplex, as all are at first.
export interface Bare {
  positions: Float32Array; // 3 a vertex
  values: Float32Array; // 0..1: when it came; or its place
  ids: number[]; // of each
  palette: Palette;
}

const kWalls = [
  "#d97706",
  "#7c3aed",
  "#059669",
  "#db2777",
  "#0891b2",
  "#65a30d",
  "#92400e",
  "#4f46e5",
];
export const wallColour = (wall: number) => kWalls[wall % kWalls.length];

// Paler than those of walls, whose curves are seen on them.
const kRegions = [
  "#8fb3e8",
  "#f2c078",
  "#93cfa4",
  "#e3a1c4",
  "#b3a4e6",
  "#86cfcb",
  "#d9a58a",
  "#c7cf7e",
];
export const regionColour = (label: number) =>
  kRegions[(label + kRegions.length - 1) % kRegions.length];

// What became of the points of a reconstruction, as Place of the protocol numbers them. What is in the
// mesh is cool, what was left out grey, what is at fault warm.
export const kPlaces: { name: string; colour: string }[] = [
  { name: "ok", colour: "#8fb3e8" },
  { name: "merged", colour: "#7a8494" },
  { name: "dropped", colour: "#4b5563" },
  { name: "tiled", colour: "#2a9d8f" },
  { name: "weighted", colour: "#7c3aed" },
  { name: "edge", colour: "#f59e0b" },
  { name: "sheets", colour: "#db2777" },
  { name: "noise", colour: "#a16207" },
  { name: "sparse", colour: "#dc2626" },
  { name: "close", colour: "#ea580c" },
  { name: "disagree", colour: "#7f1d1d" },
];

export function paletteColour(palette: Exclude<Palette, "map">, value: number): string {
  if (palette === "wall") return wallColour(value);
  return palette === "region" ? regionColour(value) : (kPlaces[value] ?? kPlaces[0]).colour;
}

// The coordinates' own axes, chosen by hand.
export function axesFrame(d: number, axes: number[]): number[] {
  const frame = new Array<number>(3 * d).fill(0);
  axes.forEach((axis, row) => {
    if (axis >= 0 && axis < d) frame[row * d + axis] = 1;
  });
  return frame;
}

function random(seed: number): () => number {
  let s = seed >>> 0;
  return () => {
    s = (s + 0x6d2b79f5) >>> 0;
    let t = Math.imul(s ^ (s >>> 15), 1 | s);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

// A grand tour: all coordinates turn, in pairs, at speeds that never come round together, so that
// every direction is seen from every side. It begins at the given frame.
export class Tour {
  private readonly turns: { a: number; b: number; speed: number }[] = [];

  constructor(
    private readonly d: number,
    private readonly start: number[],
    still: number[] = [], // coordinates that do not turn
  ) {
    const next = random(1);
    for (let a = 0; a < d; a++) {
      for (let b = a + 1; b < d; b++) {
        if (still.includes(a) || still.includes(b)) continue;
        if (d <= 6 || next() < 6 / d) this.turns.push({ a, b, speed: 0.1 + 0.2 * next() });
      }
    }
  }

  at(seconds: number): number[] {
    const frame = this.start.slice();
    for (const { a, b, speed } of this.turns) {
      const c = Math.cos(speed * seconds);
      const s = Math.sin(speed * seconds);
      for (let row = 0; row < 3; row++) {
        const x = frame[row * this.d + a];
        const y = frame[row * this.d + b];
        frame[row * this.d + a] = c * x - s * y;
        frame[row * this.d + b] = s * x + c * y;
      }
    }
    return frame;
  }
}
