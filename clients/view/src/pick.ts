// What of a mesh is under the pointer, and what is to be said of it.
import { wallsOf } from "./boundary";
import { kPlaces, type Bare, type Shape } from "./look";
import { fattest, Simplices } from "./measure";
import type { Found, Ray } from "./messages";
import type { MeshStore } from "./store";

const kHitPixels = 6; // a line or a dot is hit within so many
const kVertexPixels = 9; // of a simplex' corner: the vertex is meant

export interface Hit {
  row: number; // of the shape's triangles or segments, or of the bare vertices
  way: number; // from the ray's origin
}

type Vector = ArrayLike<number>;

const dot = (a: Vector, b: Vector) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a: Vector, b: Vector) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];

// The first triangle on the ray (Moeller and Trumbore), of a million in a blink: nothing is allocated.
function triangleHit({ positions: p, index }: Shape, { origin, direction }: Ray): Hit | null {
  const [ox, oy, oz] = origin;
  const [dx, dy, dz] = direction;
  let best: Hit | null = null;
  const count = (index?.length ?? p.length / 3) / 3;
  for (let row = 0; row < count; row++) {
    const a = 3 * (index ? index[3 * row] : 3 * row);
    const b = 3 * (index ? index[3 * row + 1] : 3 * row + 1);
    const c = 3 * (index ? index[3 * row + 2] : 3 * row + 2);
    const ux = p[b] - p[a];
    const uy = p[b + 1] - p[a + 1];
    const uz = p[b + 2] - p[a + 2];
    const vx = p[c] - p[a];
    const vy = p[c + 1] - p[a + 1];
    const vz = p[c + 2] - p[a + 2];
    const nx = dy * vz - dz * vy;
    const ny = dz * vx - dx * vz;
    const nz = dx * vy - dy * vx;
    const det = ux * nx + uy * ny + uz * nz;
    if (det === 0) continue; // seen from its edge
    const fx = ox - p[a];
    const fy = oy - p[a + 1];
    const fz = oz - p[a + 2];
    const s = (fx * nx + fy * ny + fz * nz) / det;
    if (s < 0 || s > 1) continue;
    const qx = fy * uz - fz * uy;
    const qy = fz * ux - fx * uz;
    const qz = fx * uy - fy * ux;
    const t = (dx * qx + dy * qy + dz * qz) / det;
    if (t < 0 || s + t > 1) continue;
    const way = (vx * qx + vy * qy + vz * qz) / det;
    if (way > 0 && (best === null || way < best.way)) best = { row, way };
  }
  return best;
}

// How many pixels from the ray a point is, and how far along it.
function awayFrom({ origin, direction, pixel }: Ray, point: Vector): [pixels: number, way: number] {
  const from = minus(point, origin);
  const way = dot(from, direction);
  if (way <= 0) return [Infinity, way];
  return [Math.sqrt(Math.max(dot(from, from) - way * way, 0)) / (pixel * way), way];
}

// Where the line of the ray and that of a segment are nearest, on the segment.
function nearestOn(a: Vector, b: Vector, { origin, direction }: Ray): number[] {
  const along = minus(b, a);
  const from = minus(a, origin);
  const slant = dot(along, direction);
  const det = dot(along, along) - slant * slant;
  const t = det > 0 ? (slant * dot(from, direction) - dot(from, along)) / det : 0;
  const s = Math.min(Math.max(t, 0), 1);
  return [0, 1, 2].map((i) => a[i] + s * along[i]);
}

// The nearest line to the eye of those within some pixels.
function segmentHit({ positions, index }: Shape, ray: Ray): Hit | null {
  let best: Hit | null = null;
  const end = (i: number) => {
    const at = 3 * (index ? index[i] : i);
    return positions.subarray(at, at + 3);
  };
  const count = (index?.length ?? positions.length / 3) / 2;
  for (let row = 0; row < count; row++) {
    const [pixels, way] = awayFrom(ray, nearestOn(end(2 * row), end(2 * row + 1), ray));
    if (pixels < kHitPixels && way < (best?.way ?? Infinity)) best = { row, way };
  }
  return best;
}

// Ids of what the ray meets first: one of a vertex, several of a simplex. Empty: nothing.
export function hitBy(
  ray: Ray,
  shape: Shape,
  bare: Bare,
  store: MeshStore,
  projected: Float32Array,
): number[] {
  const hit = shape.kind === "triangles" ? triangleHit(shape, ray) : segmentHit(shape, ray);
  let least = kHitPixels;
  let dots: number[] = [];
  bare.ids.forEach((id, i) => {
    const [pixels, way] = awayFrom(ray, bare.positions.subarray(3 * i, 3 * i + 3));
    if (pixels >= least || way > (hit?.way ?? Infinity)) return;
    least = pixels;
    dots = [id];
  });
  if (hit === null || dots.length > 0) return dots;
  const width = store.k + 1;
  const cell = shape.cells ? shape.cells[hit.row] : hit.row;
  const ids = [...store.cells.subarray(cell * width, (cell + 1) * width)];
  const near = ids
    .map((id) => ({ id, away: awayFrom(ray, projected.subarray(3 * id, 3 * id + 3)) }))
    .filter(({ away: [pixels, way] }) => pixels < kVertexPixels && way < 1.02 * hit.way)
    .sort((a, b) => a.away[0] - b.away[0]);
  return near.length > 0 ? [near[0].id] : ids;
}

const brief = (x: number) => `${Number(x.toPrecision(5))}`;
const share = (x: number) => `${Number(x.toPrecision(3))}`;

function vertexRows(store: MeshStore, id: number): Found["rows"] {
  const { d, k, points, cells, simplices, places } = store;
  let around = 0;
  for (let i = 0; i < simplices * (k + 1); i++) if (cells[i] === id) around++;
  const at = [...points.subarray(id * d, (id + 1) * d)];
  return [
    ["coordinates", at.map(brief).join(", ")],
    ["simplices about it", around.toLocaleString("en")],
    ...wallRows(store, [id]),
    ...(places ? [["became", (kPlaces[places[id]] ?? kPlaces[0]).name] as [string, string]] : []),
  ];
}

function wallRows(store: MeshStore, ids: number[]): Found["rows"] {
  const walls = wallsOf(store, ids);
  const on = Array.from({ length: 64 }, (_, wall) => wall).filter((w) => (walls >> BigInt(w)) & 1n);
  return on.length > 0 ? [[on.length > 1 ? "walls" : "wall", on.join(", ")]] : [];
}

const kVolumes = ["", "length", "area", "volume"];

function simplexRows(store: MeshStore, ids: number[], cell: number, most: number): Found["rows"] {
  const { k } = store;
  const simplices = new Simplices(store);
  simplices.measure(cell);
  const { radius, volume, shortest, longest } = simplices;
  const rows: Found["rows"] = [
    ["circumradius", `${brief(radius)}${most > 0 ? `, ${share(radius / most)} of epsilon` : ""}`],
  ];
  const factorial = Array.from({ length: k }, (_, i) => i + 1).reduce((a, b) => a * b, 1);
  rows.push([kVolumes[k] ?? `${k}-volume`, brief(volume / factorial)]);
  if (k > 1) {
    rows.push(
      ["edges", `${brief(shortest)} to ${brief(longest)}`],
      ["radius / shortest edge", brief(radius / shortest)],
      ["fatness", `${share(volume / longest ** k / fattest(k))} of the regular one's`],
    );
  }
  const angles: number[] = [];
  if (k === 2) simplices.angles(cell, (x) => angles.push(x));
  if (k === 3) simplices.dihedral(cell, (x) => angles.push(x));
  if (angles.length > 0) {
    const [low, high] = [Math.min(...angles), Math.max(...angles)].map((x) => x.toFixed(1));
    rows.push([k === 2 ? "angles" : "dihedral angles", `${low}° to ${high}°`]);
  }
  if (store.labelCount > 0) rows.push(["region", `${store.regionOf(cell)}`]);
  return [...rows, ...wallRows(store, ids)];
}

// Of a vertex or a simplex; null: the mesh has no such. `most`: epsilon; 0: there is none.
export function describeFound(store: MeshStore, ids: number[], most: number): Found | null {
  if (ids.length === 0 || ids.some((id) => !(id >= 0 && id < store.vertices))) return null;
  if (ids.length === 1) {
    return { ids, title: `vertex ${ids[0]}`, rows: vertexRows(store, ids[0]) };
  }
  const sorted = ids.slice().sort((a, b) => a - b);
  const cell = store.cellOf(sorted);
  if (cell < 0) return null;
  return {
    ids: sorted,
    title: `simplex ${sorted.join(" ")}`,
    rows: simplexRows(store, sorted, cell, most),
  };
}
