// What the page and its worker say to each other.
import type { Bare, Look, Rim, Scale, Shape } from "./look";
import type { Histogram } from "./measure";
import type { Recording } from "./source";

export interface MeshRow {
  name: string;
  label: string;
  state: string;
  over: boolean;
  k: number;
  d: number;
  epsilon: number;
  vertices: number;
  simplices: number;
  fraction: number;
  elapsed: number;
  remaining: number;
  phase: string;
  round: number;
  queries: number;
  revision: number;
  walls: number;
  regions: number[]; // their labels, where there are any
  boundaryOnly: boolean;
  scaled: boolean; // its axes have different units: lengths are of coordinates divided by these
  ofPoints: boolean; // a reconstruction: no oracle, no epsilon, no rules
  places: number[]; // of a reconstruction that is over: what became of its points, as of kPlaces
  certified: boolean | null; // null: not over
}

export interface PastRow {
  revision: number;
  vertices: number;
  simplices: number;
  size: number;
  radiusEdge: number;
  sliver: number;
  inconsistent: number;
  front: number;
}

export interface WorkerRow {
  number: number;
  displayName: string;
  queries: number;
  chunks: number;
  perSecond: number; // 0: unknown
  newestChunk: number;
  unanswered: number;
  lagging: boolean;
}

export type FaultKind = "faces" | "links" | "stars" | "inconsistent" | "fibres";

// What is looked at: one of those that the certificate names, or what its words name.
export type Fault = { kind: FaultKind; chosen: number } | { ids: number[] };

// What is looked for under the pointer, in the picture's space. A pixel at distance t from the origin is
// t * pixel wide.
export interface Ray {
  origin: [number, number, number];
  direction: [number, number, number]; // of length 1
  pixel: number;
}

// A vertex or a simplex, and what is known of it.
export interface Found {
  ids: number[];
  title: string;
  rows: [name: string, text: string][];
}

// A line of the certificate; with faults, it leads to them.
export interface Claim {
  title: string;
  text: string;
  holds: boolean | null; // null: a number, not a verdict
  faults?: FaultKind;
  count?: number; // of the ids that came
}

export interface Verdict {
  level: "refused" | "sampled" | "proved" | "failed" | "unfinished";
  headline: string;
  text: string;
  claims: Claim[];
  warnings: string[];
}

// `asked`: how many times the page has asked for another picture, with this one. A scene says which of
// them it answers.
export type ToWorker = Told & { asked?: number };

export type Told =
  | { type: "open"; host: string; secret: string; lists: boolean } // says what meshes there are
  | { type: "replay"; recording: Recording }
  | { type: "watch"; name: string }
  | { type: "revision"; revision: number | null } // null: the newest, as it comes
  | { type: "look"; name: string; look: Look } // at that mesh: others may have other dimensions
  | { type: "faults"; fault: Fault | null }
  | { type: "pick"; ray: Ray; pin: boolean } // pinned: stays marked
  | { type: "find"; ids: number[] } // pins it, and flies there; none: nothing is pinned
  | { type: "save"; format: Format }
  | { type: "measure" }
  | { type: "drawn" };

export type Format = "txt" | "obj" | "vtu";

export interface Scene {
  type: "scene";
  asked: number; // as of ToWorker: all that was asked until then is in it
  name: string;
  revision: number;
  vertices: number;
  simplices: number;
  shape: Shape;
  rim: Rim;
  bare: Bare;
  drawn: boolean; // any of it
  boundary: string; // in words; empty: none
  faults: Float32Array; // positions of vertices at fault
  faultEdges: Float32Array; // pairs of positions
  chosen: Float32Array; // of the fault that was chosen
  chosenEdges: Float32Array; // pairs of positions, of the simplices about it
  pinned: Float32Array; // positions of the vertices of what is pinned
  pinnedEdges: Float32Array; // pairs of positions
  scale: Scale | null; // of the colours
  // The smallest ball about the middle that holds the mesh, from whatever side it is seen.
  centre: [number, number, number];
  radius: number;
}

// `of`: the mesh that it is about, where it is about one. Another may have been chosen meanwhile.
export type FromWorker = Said & { of?: string };

export type Said =
  | { type: "greeting"; server: string; mesh: string; secret: string }
  | { type: "connection"; ok: boolean; message: string }
  | { type: "list"; meshes: MeshRow[] }
  | { type: "mesh"; mesh: MeshRow }
  | { type: "past"; rows: PastRow[] }
  | { type: "workers"; rows: WorkerRow[] }
  | { type: "verdict"; verdict: Verdict | null }
  | { type: "histograms"; histograms: Histogram[]; revision: number }
  | {
      type: "fly";
      centre: [number, number, number];
      radius: number;
      normal: [number, number, number]; // zero: none
      level: number;
      text: string;
      found?: boolean; // it was looked for by number, and is no fault
    }
  | { type: "found"; found: Found | null; pin: boolean }
  | { type: "saved"; format: Format; file: Blob | null; message: string } // null: why, in words
  | { type: "loading"; text: string }
  | Scene;
