// A mesh's status and certificate, as people read them.
import { indices } from "./arrays";
import {
  CertificateLevel,
  MeshState,
  Phase,
  type Certificate,
  type Mesh,
  type MeshSpec,
  type WorkerStats,
} from "./generated/stellate/v1/mesh_pb";
import type { Claim, WorkerRow, FaultKind, MeshRow, PastRow, Verdict } from "./messages";

const kOver = new Set([
  MeshState.SUCCEEDED,
  MeshState.STOPPED,
  MeshState.CANCELLED,
  MeshState.FAILED,
]);

export function isOver(mesh: Mesh): boolean {
  return kOver.has(mesh.state);
}

// Of the boundary alone simplices have a dimension less.
export function simplexDimension(spec: MeshSpec): number {
  return spec.dimension - (spec.boundaryOnly ? 1 : 0);
}

export function rowOf(mesh: Mesh): MeshRow {
  const progress = mesh.progress;
  return {
    name: mesh.name,
    label: mesh.spec?.label ?? "",
    state: MeshState[mesh.state].toLowerCase(),
    over: isOver(mesh),
    k: mesh.spec ? simplexDimension(mesh.spec) : 0,
    d: mesh.spec?.ambientDimension ?? 0,
    epsilon: mesh.spec?.epsilon ?? 0,
    vertices: Number(progress?.vertices ?? 0),
    simplices: Number(progress?.simplices ?? 0),
    fraction: progress?.fraction ?? 0,
    elapsed: progress?.elapsedSeconds ?? 0,
    remaining: progress?.remainingSeconds ?? 0,
    phase: Phase[progress?.phase ?? 0].toLowerCase(),
    round: Number(progress?.round ?? 0),
    queries: Number(progress?.queries ?? 0),
    revision: Number(mesh.revision),
    walls: mesh.spec?.walls ?? 0,
    regions: [...new Set(mesh.spec?.labels)].filter((label) => label > 0).sort((a, b) => a - b),
    boundaryOnly: mesh.spec?.boundaryOnly ?? false,
    scaled: (mesh.spec?.scale.length ?? 0) > 0,
    ofPoints: mesh.spec?.reconstruction !== undefined,
    places: mesh.report?.reconstruction?.places.map(({ place }) => place) ?? [],
    certified: isOver(mesh) ? (mesh.report?.certificate?.certified ?? false) : null,
  };
}

export function pastOf(mesh: Mesh): PastRow[] {
  return mesh.pastProgress.map(({ revision, progress }) => ({
    revision: Number(revision),
    vertices: Number(progress?.vertices ?? 0),
    simplices: Number(progress?.simplices ?? 0),
    size: Number(progress?.badSize ?? 0),
    radiusEdge: Number(progress?.badRadiusEdge ?? 0),
    sliver: Number(progress?.badSliver ?? 0),
    inconsistent: Number(progress?.badInconsistent ?? 0),
    front: Number(progress?.unboundedStars ?? 0),
  }));
}

// At chunks like its newest; 0: not known.
function speedOf({ fixedSeconds, eachSeconds, newestChunk }: WorkerStats): number {
  const n = Number(newestChunk);
  const seconds = fixedSeconds + n * eachSeconds;
  return seconds > 0 ? n / seconds : 0;
}

export function workersOf(mesh: Mesh): WorkerRow[] {
  return mesh.workerStats.map((worker) => ({
    number: Number(worker.number),
    displayName: worker.displayName,
    queries: Number(worker.queries),
    chunks: Number(worker.chunks),
    perSecond: speedOf(worker),
    newestChunk: Number(worker.newestChunk),
    unanswered: Number(worker.unanswered),
    lagging: worker.lagging,
  }));
}

// The ids at fault, by kind, and how many make one fault.
export function faultsOf(mesh: Mesh): Map<FaultKind, { ids: Uint32Array; width: number }> {
  const violations = mesh.report?.certificate?.violations;
  const k = mesh.spec ? simplexDimension(mesh.spec) : 1;
  return new Map([
    ["faces", { ids: indices(violations?.faces), width: k }],
    ["links", { ids: indices(violations?.links), width: 1 }],
    ["stars", { ids: indices(violations?.stars), width: 1 }],
    ["inconsistent", { ids: indices(violations?.inconsistent), width: 1 }],
    ["fibres", { ids: indices(violations?.fibres), width: 1 }],
  ]);
}

const grouped = (n: bigint | number) => n.toLocaleString("en");
const brief = (x: number) => (x === 0 ? "0" : Number(x.toPrecision(4)).toString());

function claimsOf(mesh: Mesh, c: Certificate): Claim[] {
  const faults = faultsOf(mesh);
  const count = (kind: FaultKind) => {
    const found = faults.get(kind);
    return found ? found.ids.length / found.width : 0;
  };
  const claims: Claim[] = [];
  const check = (title: string, holds: boolean, well: string, ill: string, kind?: FaultKind) => {
    const found = kind ? count(kind) : 0;
    claims.push({
      title,
      text: holds ? well : ill,
      holds,
      ...(found > 0 ? { faults: kind, count: found } : {}),
    });
  };
  const number = (title: string, text: string) => claims.push({ title, text, holds: null });
  const k = mesh.spec ? simplexDimension(mesh.spec) : 0;
  const ends = (mesh.spec?.walls ?? 0) > 0 && !mesh.spec?.boundaryOnly;
  const face = ["", "vertex", "edge", "triangle"][k] ?? `${k - 1}-face`;
  check(
    "Closed",
    c.closed,
    `every ${face} is in two simplices${ends ? ", or in one and in the boundary" : ""}`,
    `${grouped(c.badFaces)} faces are not${ends ? ", nor where the mesh should end" : " in two simplices"}`,
    "faces",
  );
  check(
    "Links",
    c.linksAreSpheres,
    `all are spheres${ends ? ", balls at the boundary" : ""}, decided ${c.linksDecidedExactly ? "exactly" : "by homology"}`,
    `${grouped(c.badLinks)} vertices have a link that is no sphere${ends ? " or ball" : ""}`,
    "links",
  );
  check(
    "Consistent",
    c.inconsistentSimplices === 0n,
    "every simplex is in the stars of all its vertices",
    `${grouped(c.inconsistentSimplices)} simplices are in some of their stars only`,
    "inconsistent",
  );
  check(
    "Embedded",
    c.unembeddedStars === 0n,
    "each star embeds in the tangent space of its centre",
    `${grouped(c.unembeddedStars)} stars overlap themselves`,
    "stars",
  );
  const ofPoints = mesh.spec?.reconstruction !== undefined;
  if (ofPoints) {
    number("Normal flats", "none: points have no oracle");
  } else if (mesh.spec?.boundaryOnly) {
    number("Normal flats", "not asked of a boundary alone");
  } else {
    check(
      "Normal flats",
      c.fibreFailures === 0n && c.fibreSamples > 0n,
      `${grouped(c.fibreSamples)} sampled, each meets the mesh once`,
      c.fibreSamples === 0n
        ? "not asked"
        : `${grouped(c.fibreFailures)} of ${grouped(c.fibreSamples)} do not meet the mesh once`,
      "fibres",
    );
  }
  number("Euler char.", grouped(c.eulerCharacteristic));
  number("Components", grouped(c.components));
  number("Orientable", c.orientable ? "yes" : "no");
  const [radius, epsilon] = [c.maxCircumradius, mesh.spec?.epsilon ?? 0].map(brief);
  const large = !ofPoints && !c.certified && Number(radius) > Number(epsilon); // as they read
  claims.push({
    title: "Circumradius",
    text: `at most ${radius}${ofPoints ? "" : `, epsilon is ${epsilon}`}`,
    holds: large ? false : null,
  });
  number("Radius / edge", `at most ${brief(c.maxRadiusEdge)}`);
  number("Fatness", `at least ${brief(c.minFatness)}`);
  if (k === 2) number("Angles", `at least ${brief(c.minAngleDegrees)}°`);
  const size = ofPoints ? "the largest circumradius" : "epsilon";
  const reach = Number.isFinite(c.estimatedReach)
    ? `${c.certified ? "about" : "at most"} ${brief(c.estimatedReach)}, ${size} is ${brief(c.epsilonOverReach)} of it`
    : "nothing limits it: all is flat";
  const coarse = c.onlyTooCoarse || (!c.certified && c.epsilonOverReach >= 1);
  if (c.estimatedReach > 0)
    claims.push({ title: "Reach", text: reach, holds: coarse ? false : null });
  if (c.declaredReach > 0) {
    const holds = c.reachRefuted ? false : null;
    claims.push({ title: "Reach declared", text: brief(c.declaredReach), holds });
  }
  if (c.provedDistance > 0) number("Distance", `at most ${brief(c.provedDistance)}`);
  if (!c.certified && claims.every(({ holds }) => holds !== false)) {
    claims.unshift({ title: "Not in this list", text: "what the words above name", holds: false });
  }
  return claims;
}

export function verdictOf(mesh: Mesh): Verdict | null {
  const report = mesh.report;
  if (!isOver(mesh) || !report) return null;
  const state = MeshState[mesh.state].toLowerCase();
  const certificate = report.certificate;
  if (report.failure || !certificate) {
    const { reason, message } = report.failure ?? { reason: "", message: `the mesh ${state}` };
    return {
      level: "failed",
      headline: reason ? `Failed: ${reason}` : `Ended: ${state}`,
      text: message,
      claims: [],
      warnings: [],
    };
  }
  const { level, verdict } = certificate;
  const unfinished = mesh.state !== MeshState.SUCCEEDED;
  const headline = {
    [CertificateLevel.PROVED]: "Proved",
    [CertificateLevel.SAMPLED]: "Certified",
    [CertificateLevel.DECIDED]: "A manifold, not certified",
    [CertificateLevel.REFUSED]: unfinished ? `Not certified: ${state}` : "Not certified",
    [CertificateLevel.UNSPECIFIED]: certificate.certified ? "Certified" : "Not certified",
  }[level];
  return {
    level:
      level === CertificateLevel.PROVED
        ? "proved"
        : certificate.certified
          ? "sampled"
          : unfinished
            ? "unfinished"
            : "refused",
    headline,
    // The headline says whether it is certified.
    text: verdict
      .replace(/^((not )?certified|proved)\W+/i, "")
      .replace(/^./, (first) => first.toUpperCase()),
    // Of a run that did not converge, only what is at fault was looked at.
    claims: unfinished ? unfinishedClaims(mesh, certificate) : claimsOf(mesh, certificate),
    warnings: certificate.warnings,
  };
}

function unfinishedClaims(mesh: Mesh, c: Certificate): Claim[] {
  const looked = claimsOf(mesh, c).filter(
    (claim) =>
      (claim.title === "Consistent" && mesh.progress?.simplices) || claim.title === "Reach",
  );
  return [{ title: "Finished", text: "rules still ask for points", holds: false }, ...looked];
}
