// A mesh on its way from the server to the screen.
import { create, fromBinary, toBinary } from "@bufbuild/protobuf";
import { doubles, indices } from "./arrays";
import { describe } from "./boundary";
import { faultsIn, flightTo, marksOf, pinOf, type Faults } from "./faults";
import { MeshSchema, type Mesh, type MeshDelta } from "./generated/stellate/v1/mesh_pb";
import {
  DownloadMeshRequestSchema,
  DownloadMeshResponseSchema,
  GetMeshRequestSchema,
  WatchMeshRequestSchema,
  WatchMeshResponseSchema,
} from "./generated/stellate/v1/stellate_pb";
import { fileOf } from "./formats";
import type { Bare, Look, Shape } from "./look";
import { histograms } from "./measure";
import type { Fault, Format, PastRow, Ray, Said, Scene } from "./messages";
import { rimOf } from "./rim";
import { report, send as say, sleep } from "./say";
import { extent, scaleOf } from "./paint";
import { describeFound, hitBy } from "./pick";
import { bareOf, project, shapeOf } from "./shape";
import type { Source } from "./source";
import { MeshStore } from "./store";
import { workersOf, faultsOf, isOver, pastOf, rowOf, simplexDimension, verdictOf } from "./verdict";

const kLookSeconds = 1;
const kDrawSeconds = 0.1; // ten frames a second while it grows
const kFirstPause = 0.25;
const kLongestPause = 5;
const kRemembered = 6; // revisions that the slider came by

// A mesh that is looked at, until another is.
export class Viewing {
  private readonly stop = new AbortController();
  private look: Look | null = null; // the page's first, once it knows what is looked at
  private store: MeshStore | null = null; // the newest
  private shown: MeshStore | null = null; // an earlier revision; null: the newest
  private readonly earlier = new Map<number, MeshStore>();
  private wanted: number | null = null;
  private fetching = false;
  private mesh: Mesh | null = null;
  private past: PastRow[] = [];
  private over = false;
  private fault: Fault | null = null;
  private flightDue = false; // to it, once it is there
  private pinned: number[] = []; // ids of a vertex or a simplex
  private seen: { store: MeshStore; shape: Shape; bare: Bare; projected: Float32Array } | null =
    null;
  private due = false;
  private answered = 0; // as of ToWorker
  private waiting = false; // the page has not drawn the last scene yet
  private drawnAt = 0;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly source: Source,
    readonly name: string,
    private readonly asked: () => number, // as of ToWorker, lately
  ) {
    void this.inquire();
    void this.watch();
  }

  private send(message: Said, transfer: Transferable[] = []) {
    say({ ...message, of: this.name }, transfer);
  }

  leave() {
    this.stop.abort();
    clearTimeout(this.timer);
  }

  // The largest circumradius, which is epsilon where it is bounded.
  private get largest(): number {
    const { spec, report } = this.mesh ?? {};
    return spec?.epsilon || report?.certificate?.maxCircumradius || 1;
  }
  private get visible(): MeshStore | null {
    return this.shown ?? (this.wanted === null ? this.store : null);
  }

  // State, workers and history, again and again until it is over.
  private async inquire() {
    let wasOver = false;
    while (!this.stop.signal.aborted) {
      const request = create(GetMeshRequestSchema, {
        name: this.name,
        workerStats: true,
        pastProgressAfter: BigInt(this.past.at(-1)?.revision ?? 0),
      });
      const end = await this.source.call(
        "GetMesh",
        toBinary(GetMeshRequestSchema, request),
        (frame) => this.hear(fromBinary(MeshSchema, frame)),
        { stop: this.stop.signal },
      );
      // Once more after the end, for what came between.
      if (end.code === 0 && wasOver) return;
      wasOver = end.code === 0 && this.mesh !== null && isOver(this.mesh) && this.over;
      if (!this.source.live) return;
      await sleep(kLookSeconds);
    }
  }

  private hear(mesh: Mesh) {
    if (this.stop.signal.aborted) return;
    if (this.store === null) {
      const { ambientDimension: d, scale } = mesh.spec!;
      const units = scale.length === d ? scale : undefined;
      this.store = new MeshStore(simplexDimension(mesh.spec!), d, units);
    }
    const ended = mesh.endTime !== undefined;
    this.mesh = mesh;
    this.send({ type: "mesh", mesh: rowOf(mesh) });
    this.send({ type: "verdict", verdict: ended ? verdictOf(mesh) : null });
    if (mesh.pastProgress.length > 0) {
      this.past.push(...pastOf(mesh));
      this.send({ type: "past", rows: this.past });
    }
    this.send({ type: "workers", rows: workersOf(mesh) });
  }

  // The newest, as it comes; a connection that breaks off is opened again, from where it was.
  private async watch() {
    let pause = kFirstPause;
    let parts: MeshDelta[] = [];
    const take = (frame: Uint8Array) => {
      const { event } = fromBinary(WatchMeshResponseSchema, frame);
      pause = kFirstPause;
      if (event.case === "delta" && event.value.delta) {
        const { delta, complete } = event.value;
        parts.push(delta);
        if (!complete || this.store === null) return;
        for (const part of parts) {
          this.store.removeCells(indices(part.removed));
          this.store.addPoints(Number(part.firstVertex), doubles(part.points));
          this.store.addWalls(part.boundaryVertices, part.boundaryWalls);
          this.store.addCells(indices(part.added), part.addedLabels);
        }
        parts = [];
        this.store.revision = Number(delta.revision);
        if (this.shown === null) this.draw();
      } else if (event.case === "resetMesh") {
        this.store?.clear();
        this.draw();
      } else if (event.case === "orientation") {
        this.store?.addTurned(Number(event.value.firstSimplex), event.value.turned);
      } else if (event.case === "final") {
        this.over = true;
        this.hear(event.value);
        this.draw();
        if (event.value.spec?.reconstruction) void this.findPlaces();
      }
    };
    while (!this.stop.signal.aborted) {
      parts = [];
      if (this.store === null) {
        await sleep(0.01); // how many dimensions it has is not known yet
        continue;
      }
      const request = create(WatchMeshRequestSchema, {
        name: this.name,
        fromRevision: BigInt(this.store.revision),
      });
      const end = await this.source.call(
        "WatchMesh",
        toBinary(WatchMeshRequestSchema, request),
        take,
        {
          stop: this.stop.signal,
        },
      );
      if (this.over || this.stop.signal.aborted) return;
      report(end);
      await sleep(pause);
      pause = Math.min(2 * pause, kLongestPause);
    }
  }

  show(revision: number | null) {
    this.wanted = revision;
    if (revision === null || revision === this.store?.revision) {
      this.shown = null;
      this.draw();
    } else {
      void this.fetch();
    }
  }

  // The last revision that was asked for; those that were passed on the way are left out.
  private async fetch() {
    if (this.fetching) return;
    this.fetching = true;
    let revision = -1;
    while (this.wanted !== null && this.wanted !== revision && this.store) {
      revision = this.wanted;
      const store = this.earlier.get(revision) ?? (await this.download(revision));
      if (store === null) {
        if (this.shown === null) this.show(null); // the newest stays
        break;
      }
      this.earlier.delete(revision);
      this.earlier.set(revision, store);
      if (this.earlier.size > kRemembered) this.earlier.delete(this.earlier.keys().next().value!);
      if (this.wanted === null) break;
      this.shown = store;
      this.draw();
    }
    this.fetching = false;
    this.draw(); // what was asked is answered, be it by what is there already
  }

  private async download(revision: number): Promise<MeshStore | null> {
    const store = new MeshStore(this.store!.k, this.store!.d, this.store!.units);
    const request = create(DownloadMeshRequestSchema, {
      name: this.name,
      revision: BigInt(revision),
    });
    const end = await this.source.call(
      "DownloadMesh",
      toBinary(DownloadMeshRequestSchema, request),
      (frame) => {
        const part = fromBinary(DownloadMeshResponseSchema, frame);
        store.revision = Number(part.revision);
        store.addPoints(Number(part.firstVertex), doubles(part.points));
        store.addWalls(part.boundaryVertices, part.boundaryWalls);
        store.addCells(indices(part.cells), part.cellLabels);
      },
      { stop: this.stop.signal, revision },
    );
    // A recording has them but once: with the newest revision.
    const past = this.past.find((row) => row.revision === store.revision);
    if (!this.source.live && past && store.vertices === 0) {
      store.addPoints(0, this.store!.points.subarray(0, past.vertices * store.d));
    }
    if (end.code !== 0) this.send({ type: "loading", text: end.message });
    return end.code === 0 ? store : null;
  }

  // What became of the points of a reconstruction, which comes with them in a download alone.
  private async findPlaces() {
    const store = this.store;
    if (store === null || store.vertices === 0) return;
    const places = new Uint8Array(store.vertices);
    const enough = new AbortController();
    this.stop.signal.addEventListener("abort", () => enough.abort());
    const request = create(DownloadMeshRequestSchema, {
      name: this.name,
      revision: BigInt(store.revision),
    });
    const take = (frame: Uint8Array) => {
      const part = fromBinary(DownloadMeshResponseSchema, frame);
      const first = Number(part.firstVertex);
      const codes = part.places?.codes ?? new Uint8Array();
      if (first + codes.length <= places.length) places.set(codes, first);
      if (codes.length > 0) store.places = places;
      if (part.cells !== undefined && part.cells.data.length > 0) enough.abort();
    };
    await this.source.call("DownloadMesh", toBinary(DownloadMeshRequestSchema, request), take, {
      stop: enough.signal,
      revision: store.revision,
    });
    this.draw();
  }

  lookAt(look: Look) {
    this.look = look;
    this.draw();
  }

  choose(fault: Fault | null) {
    this.fault = fault;
    this.flightDue = fault !== null;
    this.draw();
  }

  private faults(store: MeshStore): Faults {
    if (this.fault === null || this.mesh === null) return { all: [], chosen: [] };
    if ("kind" in this.fault) {
      return faultsIn(store, faultsOf(this.mesh).get(this.fault.kind), this.fault.chosen);
    }
    const { ids } = this.fault;
    return faultsIn(store, { ids: Uint32Array.from(ids), width: ids.length }, 0);
  }

  // What is under the pointer, of what was drawn last.
  pick(ray: Ray, pin: boolean) {
    if (this.seen) {
      const { store, shape, bare, projected } = this.seen;
      this.tell(store, hitBy(ray, shape, bare, store, projected), pin);
    }
    if (pin) this.draw();
  }

  find(ids: number[]) {
    this.draw();
    const store = this.visible;
    if (store === null) return;
    this.tell(store, ids, true);
    if (this.pinned.length === 0 || this.look === null) return;
    const projected = project(store, this.look.frame);
    const faults = { all: [], chosen: this.pinned };
    const flight = flightTo(store, this.look, projected, this.largest, faults);
    if (flight) this.send({ ...flight, found: true });
  }

  private tell(store: MeshStore, ids: number[], pin: boolean) {
    const found = describeFound(store, ids, this.mesh?.spec?.epsilon ?? 0);
    this.send({ type: "found", found, pin });
    if (pin) this.pinned = found?.ids ?? [];
  }

  save(format: Format) {
    const store = this.visible;
    if (store) this.send({ type: "saved", format, ...fileOf(store, format) });
  }

  drawn() {
    this.waiting = false;
    if (this.due) this.draw();
  }

  // Soon: not before the page has drawn what it has, and not too often.
  private draw() {
    this.due = true;
    if (this.waiting || this.timer !== undefined) return;
    const growing = !this.over && this.shown === null;
    const rest = growing ? kDrawSeconds - (performance.now() - this.drawnAt) / 1000 : 0;
    this.timer = setTimeout(
      () => {
        this.timer = undefined;
        this.render();
      },
      1000 * Math.max(rest, 0),
    );
  }

  private render() {
    const store = this.visible;
    if (store === null || this.look === null || this.stop.signal.aborted) return;
    this.due = false;
    this.waiting = true;
    this.drawnAt = performance.now();
    if (!this.fetching) this.answered = this.asked();
    const projected = project(store, this.look.frame);
    const shape = shapeOf(store, this.look, projected, this.largest);
    const rim = rimOf(store, this.look, projected);
    const bare = bareOf(store, projected, this.look);
    const corners = shape.index ?? shape.positions;
    const drawn = [corners, rim.segments, rim.points, bare.positions].some((x) => x.length > 0);
    const faults = this.faults(store);
    const flight = flightTo(store, this.look, projected, this.largest, faults);
    if (this.flightDue && flight !== null) {
      this.flightDue = false;
      this.send(flight);
    }
    const scene: Scene = {
      type: "scene",
      asked: this.answered,
      name: this.name,
      revision: store.revision,
      vertices: store.vertices,
      simplices: store.simplices,
      shape,
      rim,
      bare,
      drawn,
      boundary: describe(store),
      ...marksOf(store, projected, faults),
      ...pinOf(store, projected, this.pinned),
      scale: scaleOf(store, this.look, this.largest),
      ...ballOf(store, this.look),
    };
    this.seen = { store, shape, bare, projected }; // the page gets a copy: the pointer asks for it
    this.send({ ...scene, shape: { ...shape, cells: null } });
  }

  measure() {
    const store = this.visible;
    if (store === null || store.simplices === 0) return;
    this.send({
      type: "histograms",
      histograms: histograms(
        store,
        this.largest,
        this.mesh?.spec?.reconstruction ? "the largest" : "epsilon",
      ),
      revision: store.revision,
    });
  }
}

// The same size from all sides, so that a tour does not breathe.
function ballOf(store: MeshStore, { frame }: Look): Pick<Scene, "centre" | "radius"> {
  const { d, vertices, points, units } = store;
  const middle = Array.from({ length: d }, (_, axis) => {
    const [low, high] = extent(store, axis);
    return (low + high) / 2 / units[axis];
  });
  let radius = 0;
  for (let v = 0; v < vertices; v++) {
    let squared = 0;
    for (let i = 0; i < d; i++) squared += (points[v * d + i] / units[i] - middle[i]) ** 2;
    if (squared > radius) radius = squared;
  }
  const centre = [0, 1, 2].map((row) =>
    middle.reduce((all, x, i) => all + frame[row * d + i] * x, 0),
  );
  return { centre: centre as [number, number, number], radius: Math.sqrt(radius) || 1 };
}
