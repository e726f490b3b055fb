// What colours a mesh: a value of each vertex or simplex, and what it says.
import { wallOf } from "./boundary";
import type { Look, Palette, Scale } from "./look";
import { fattest, Simplices } from "./measure";
import type { MeshStore } from "./store";

export function extent(store: MeshStore, axis: number): [low: number, high: number] {
  let low = Infinity;
  let high = -Infinity;
  for (let v = 0, at = axis; v < store.vertices; v++, at += store.d) {
    const x = store.points[at];
    if (x < low) low = x;
    if (x > high) high = x;
  }
  return low <= high ? [low, high] : [0, 1];
}

// Vertices' values and what they are. Of what is told by simplex, walls and regions, none.
export interface Paint {
  values: Float32Array; // of each vertex; NaN: no colour of its own
  palette: Palette;
  byCell: ((cell: number) => number) | null; // the same for all of a simplex
}

export function paintOf(store: MeshStore, look: Look, epsilon: number): Paint {
  const values = valuesOf(store, look, epsilon);
  const { colour } = look;
  if (colour === "region") {
    return {
      values,
      palette: "region",
      byCell: (cell) => store.regionOf(cell),
    };
  }
  if (colour === "wall" && store.isBoundary) {
    const width = store.k + 1;
    const byCell = (cell: number) =>
      wallOf(store, [...store.cells.subarray(cell * width, (cell + 1) * width)]);
    return { values, palette: "wall", byCell };
  }
  return {
    values,
    palette: colour === "place" ? "place" : "map",
    byCell: null,
  };
}

// What the ends of the colour map stand for; null: it is not used.
export function scaleOf(store: MeshStore, look: Look, epsilon: number): Scale | null {
  if (look.colour === "order") return { low: 0, high: store.vertices };
  if (look.colour === "size") return { low: 0, high: epsilon };
  if (look.colour === "shape") return { low: 0, high: 1 };
  if (look.colour !== "coordinate") return null;
  const [low, high] = extent(store, look.colourAxis);
  return { low, high };
}

// Of each vertex, 0..1, or its place; NaN: no colour of its own.
function valuesOf(store: MeshStore, look: Look, epsilon: number): Float32Array {
  const { vertices, k, d } = store;
  const values = new Float32Array(vertices);
  if (look.colour === "plain" || look.colour === "wall" || look.colour === "region") {
    return values.fill(NaN);
  }
  if (look.colour === "place")
    return store.places ? values.map((_, v) => store.places![v]) : values.fill(NaN);
  if (look.colour === "order") {
    for (let v = 0; v < vertices; v++) values[v] = v / vertices;
  } else if (look.colour === "coordinate") {
    const [low, high] = extent(store, look.colourAxis);
    for (let v = 0; v < vertices; v++) {
      values[v] = (store.points[v * d + look.colourAxis] - low) / (high - low || 1);
    }
  } else {
    // The worst simplex at each vertex.
    const simplices = new Simplices(store);
    for (let cell = 0; cell < store.simplices; cell++) {
      simplices.measure(cell);
      const bad =
        look.colour === "size"
          ? Math.min(simplices.radius / epsilon, 1)
          : 1 - Math.min(simplices.volume / simplices.longest ** k / fattest(k), 1);
      for (let i = 0; i <= k; i++) {
        const v = store.cells[cell * (k + 1) + i];
        if (bad > values[v]) values[v] = bad;
      }
    }
  }
  return values;
}
