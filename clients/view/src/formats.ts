// A mesh as a file. `stellate download` writes more formats, exactly and of any size; these are for what
// is on the screen.
import type { Format } from "./messages";
import { oriented } from "./orient";
import type { MeshStore } from "./store";

type Saved = { file: Blob | null; message: string };

// VTK's numbers of the simplices of dimension 1, 2 and 3.
const kVtkTypes = [0, 3, 5, 10];

// Lines of `width` entries each, in pieces that a text can hold.
function* lines(count: number, line: (i: number) => string): Generator<string> {
  const step = 10_000;
  for (let first = 0; first < count; first += step) {
    const size = Math.min(step, count - first);
    yield Array.from({ length: size }, (_, i) => line(first + i)).join("\n") + "\n";
  }
}

function* txt(store: MeshStore): Generator<string> {
  const { k, d, points, vertices, cells, simplices } = store;
  yield `${k} ${d} ${vertices} ${simplices}\n`;
  yield* lines(vertices, (v) => points.subarray(v * d, (v + 1) * d).join(" "));
  yield* lines(simplices, (c) => cells.subarray(c * (k + 1), (c + 1) * (k + 1)).join(" "));
}

// Of three coordinates each; what there are fewer of is 0.
const inSpace = ({ points, d }: MeshStore, v: number) =>
  [0, 1, 2].map((i) => (i < d ? points[v * d + i] : 0)).join(" ");

function* obj(store: MeshStore): Generator<string> {
  const { k, vertices, simplices } = store;
  const cells = oriented(store);
  yield* lines(vertices, (v) => `v ${inSpace(store, v)}`);
  yield* lines(simplices, (c) => {
    const ids = cells.subarray(c * (k + 1), (c + 1) * (k + 1));
    return `${k === 1 ? "l" : "f"} ${Array.from(ids, (id) => id + 1).join(" ")}`;
  });
}

function* vtu(store: MeshStore): Generator<string> {
  const { k, vertices, simplices } = store;
  const cells = oriented(store);
  const array = (type: string, name: string, components = 1) =>
    `<DataArray type="${type}" Name="${name}" NumberOfComponents="${components}" format="ascii">\n`;
  yield `<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0">\n<UnstructuredGrid>\n`;
  yield `<Piece NumberOfPoints="${vertices}" NumberOfCells="${simplices}">\n<Points>\n`;
  yield array("Float64", "points", 3);
  yield* lines(vertices, (v) => inSpace(store, v));
  yield `</DataArray>\n</Points>\n<Cells>\n${array("Int64", "connectivity")}`;
  yield* lines(simplices, (c) => cells.subarray(c * (k + 1), (c + 1) * (k + 1)).join(" "));
  yield `</DataArray>\n${array("Int64", "offsets")}`;
  yield* lines(simplices, (c) => `${(c + 1) * (k + 1)}`);
  yield `</DataArray>\n${array("UInt8", "types")}`;
  yield* lines(simplices, () => `${kVtkTypes[k]}`);
  yield "</DataArray>\n</Cells>\n";
  if (store.labelCount > 0) {
    yield `<CellData>\n${array("UInt8", "region")}`;
    yield* lines(simplices, (c) => `${store.regionOf(c)}`);
    yield "</DataArray>\n</CellData>\n";
  }
  yield "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
}

const kFormats: {
  [F in Format]: { k: number; d: number; write: (store: MeshStore) => Generator<string> };
} = {
  txt: { k: Infinity, d: Infinity, write: txt },
  obj: { k: 2, d: 3, write: obj },
  vtu: { k: 3, d: 3, write: vtu },
};

export function formatsOf(k: number, d: number): Format[] {
  return (Object.keys(kFormats) as Format[]).filter(
    (format) => k <= kFormats[format].k && d <= kFormats[format].d,
  );
}

export function fileOf(store: MeshStore, format: Format): Saved {
  try {
    return { file: new Blob([...kFormats[format].write(store)]), message: "" };
  } catch (error) {
    return { file: null, message: `The file could not be made: ${String(error)}` };
  }
}
