// A surface, or a solid, with all on one side of a hyperplane taken off: where it goes through
// simplices, they are cut. Of a solid one sees its surface, and its inside where it is cut.
import { boundaryOf, wallOf } from "./boundary";
import type { Look, Shape } from "./look";
import type { Paint } from "./paint";
import { Mix, slice } from "./slice";
import type { MeshStore } from "./store";

export function cutOff(
  store: MeshStore,
  projected: Float32Array,
  paint: Paint,
  look: Look,
  height: (v: number) => number,
): Shape {
  const { k, cells, simplices } = store;
  const mix = new Mix();
  if (k === 3) slice(store, projected, paint, height, mix);
  const solid = k === 3 ? boundaryOf(store) : null;
  const ids = solid ? solid.triangles : cells;
  const count = solid ? solid.cells.length : simplices;
  const byWall = solid !== null && look.colour === "wall";
  for (let row = 0; row < count; row++) {
    const cell = solid ? solid.cells[row] : row;
    const corners = [ids[3 * row], ids[3 * row + 1], ids[3 * row + 2]];
    const kept = corners.filter((v) => height(v) < 0);
    if (kept.length === 0) continue;
    const value = byWall ? wallOf(store, corners) : (paint.byCell?.(cell) ?? null);
    const gone = corners.filter((v) => height(v) >= 0);
    // From p to where the hyperplane meets the edge to q.
    const add = (p: number, q = p) => {
      const t = p === q ? 0 : height(p) / (height(p) - height(q));
      mix.add(projected, p, q, t, value ?? (1 - t) * paint.values[p] + t * paint.values[q]);
    };
    add(kept[0]);
    if (kept.length === 1) gone.forEach((v) => add(kept[0], v));
    else add(kept[1]);
    if (kept.length === 3) add(kept[2]);
    if (kept.length === 2) {
      add(kept[1], gone[0]);
      add(kept[0]);
      add(kept[1], gone[0]);
      add(kept[0], gone[0]);
      mix.cells.push(cell);
    }
    mix.cells.push(cell);
  }
  return mix.shape("triangles", byWall ? "wall" : paint.palette);
}
