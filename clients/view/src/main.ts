// The page: what is chosen, and what of it is shown where.
import "./style.css";
import "./stage.css";
import { Curves, drawHistograms } from "./charts";
import { choicesOf, coordinates } from "./choices";
import { axesFrame, Tour, type Colour, type Look, type Part } from "./look";
import type { FaultKind, FromWorker, MeshRow, PastRow, ToWorker } from "./messages";
import {
  badgeOf,
  drawCrew,
  drawList,
  drawVerdict,
  drawWalls,
  element,
  grouped,
  seconds,
  shortName,
  superscript,
} from "./panels";
import { View } from "./scene";
import type { Recording } from "./source";
import MeshWorker from "./worker?worker&inline";

const kTourSeconds = 0.05;
const kReplaySeconds = 0.35;

const kFaults: { [K in FaultKind]: string } = {
  faces: "the face of",
  links: "the link of",
  stars: "the star of",
  inconsistent: "the star of",
  fibres: "a normal flat near",
};

const kCannotDraw =
  "This browser cannot draw the mesh: it has no WebGL, or WebGL is switched off in its settings. " +
  "Certificate and figures are beside this.";

const at = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
const css = (name: string) =>
  getComputedStyle(document.documentElement).getPropertyValue(name).trim();

const worker = new MeshWorker();
const ask = (message: ToWorker) => worker.postMessage(message);

const view = new View(at<HTMLCanvasElement>("canvas"), at("look"));
let chosen = "";
let recorded = false;
let list: MeshRow[] = [];
let mesh: MeshRow | null = null;
let past: PastRow[] = [];
let shownRevision = 0;
let boundary = ""; // of what is shown, in words
let following = true; // the newest revision
let led = false; // from mesh to mesh, by a demonstration, until somebody chooses
let fault: { kind: FaultKind; next: number; count: number } | { place: string } | null = null;
let look: Look = {
  frame: axesFrame(3, [0, 1, 2]),
  part: "whole",
  axis: 0,
  level: 0.5,
  colour: "plain",
  colourAxis: 0,
};
let replay: ReturnType<typeof setInterval> | undefined;
let tour: { tour: Tour; start: number } | null = null;
let measured = { revision: -1, name: "" };

const curves = new Curves(at("curves"), at("legend"), (revision) => show(revision));

function note(text: string) {
  at("note").hidden = false;
  at("note").textContent = text;
}

function choose(name: string) {
  if (name === chosen) return;
  chosen = name;
  mesh = null;
  past = [];
  leaveFault();
  stopReplay();
  stopTour();
  following = true;
  shownRevision = 0;
  boundary = "";
  measured = { revision: -1, name: "" };
  at("histograms").replaceChildren();
  at("stage").dataset.vertices = "0"; // what is drawn still is the last one's
  note("Waiting for the first vertices");
  view.refit();
  drawList(at("list"), list, chosen, chooseByHand);
  ask({ type: "watch", name });
}

function chooseByHand(name: string) {
  led = demo && name === list.at(-1)?.name;
  choose(name);
}

// --- what is looked at, and how

function fill(id: string, options: [value: string, text: string][], value: string) {
  const select = at<HTMLSelectElement>(id);
  select.replaceChildren(...options.map(([v, text]) => new Option(text, v, false, v === value)));
  select.value = value;
}

// How a mesh of this kind is best seen at first.
function meet(row: MeshRow) {
  const { parts, colours, first, oblique } = choicesOf(row);
  look = first;
  stopTour();
  at<HTMLInputElement>("level").value = "0.5";
  fill("part", parts, look.part);
  fill("axis", coordinates(row.d), `${look.axis}`);
  fill("colour", colours, look.colour === "coordinate" ? `${look.colourAxis}` : look.colour);
  [0, 1, 2].forEach((axis) =>
    fill(
      `axis-${axis}`,
      [["", "oblique"], ...coordinates(row.d)],
      oblique || axis >= row.d ? "" : `${axis}`,
    ),
  );
  at("axes-box").hidden = row.d <= 3;
  drawWalls(at("walls"), row.k <= 3 ? row.walls : 0);
  setParts();
  ask({ type: "look", name: chosen, look });
}

function stopTour() {
  tour = null;
  at<HTMLInputElement>("tour").checked = false;
}

function setParts() {
  const whole = look.part === "whole" || look.part === "boundary";
  at("axis-box").hidden = at("level-box").hidden = whole;
}

function changeLook(change: Partial<Look>) {
  if (mesh === null) return; // there is nothing to look at yet, and its first look comes with it
  look = { ...look, ...change };
  setParts();
  ask({ type: "look", name: chosen, look });
}

at<HTMLSelectElement>("part").onchange = (e) =>
  changeLook({ part: (e.target as HTMLSelectElement).value as Part });
at<HTMLSelectElement>("axis").onchange = (e) =>
  changeLook({ axis: Number((e.target as HTMLSelectElement).value) });
at<HTMLInputElement>("level").oninput = (e) =>
  changeLook({ level: Number((e.target as HTMLInputElement).value) });
at<HTMLSelectElement>("colour").onchange = (e) => {
  const { value } = e.target as HTMLSelectElement;
  const axis = Number(value);
  changeLook(
    Number.isNaN(axis) ? { colour: value as Colour } : { colour: "coordinate", colourAxis: axis },
  );
};
for (const id of ["axis-0", "axis-1", "axis-2"]) {
  at<HTMLSelectElement>(id).onchange = () => {
    const selects = [0, 1, 2].map((i) => at<HTMLSelectElement>(`axis-${i}`));
    if (selects.some((select) => select.value === "")) {
      selects.forEach((select, i) => (select.value = `${i}`)); // one by hand, all by hand
    }
    const axes = selects.map((select) => Number(select.value));
    stopTour();
    changeLook({ frame: axesFrame(mesh?.d ?? 3, axes) });
    view.refit();
  };
}
at<HTMLInputElement>("tour").onchange = (e) => {
  const on = (e.target as HTMLInputElement).checked;
  tour = on && mesh ? { tour: new Tour(mesh.d, look.frame), start: performance.now() } : null;
  if (!on) return;
  for (const id of ["axis-0", "axis-1", "axis-2"]) at<HTMLSelectElement>(id).value = "";
};
at<HTMLInputElement>("wires").onchange = (e) =>
  view.setWires((e.target as HTMLInputElement).checked);
at("fit").onclick = () => view.refit();
setInterval(() => {
  if (tour && !document.hidden) {
    changeLook({ frame: tour.tour.at((performance.now() - tour.start) / 1000) });
  }
}, 1000 * kTourSeconds);

// --- time

function show(revision: number | null) {
  following = revision === null;
  ask({ type: "revision", revision });
  drawTime();
}

function newest(): number {
  return Math.max(mesh?.revision ?? 0, past.at(-1)?.revision ?? 0, shownRevision, 1);
}

function drawTime() {
  const slider = at<HTMLInputElement>("revision");
  at("time").hidden = recorded && newest() === 1;
  slider.max = `${newest()}`;
  if (following) slider.value = slider.max;
  at<HTMLButtonElement>("live").disabled = following;
  at("live").textContent = mesh?.over ? "newest" : "live";
}

at<HTMLInputElement>("revision").oninput = (e) => {
  const value = Number((e.target as HTMLInputElement).value);
  stopReplay();
  show(value >= newest() ? null : value);
};
at("live").onclick = () => {
  stopReplay();
  show(null);
};

function stopReplay() {
  clearInterval(replay);
  replay = undefined;
  at("play").textContent = "replay";
}
at("play").onclick = () => {
  if (replay !== undefined) return stopReplay();
  at("play").textContent = "pause";
  let next = following || shownRevision >= newest() ? 1 : shownRevision;
  const step = Math.max(1, Math.round(newest() / 60));
  replay = setInterval(() => {
    if (next >= newest()) {
      stopReplay();
      return show(null);
    }
    at<HTMLInputElement>("revision").value = `${next}`;
    show(next);
    next += step;
  }, 1000 * kReplaySeconds);
};

// --- faults

function fly(kind: FaultKind, count: number) {
  const next = fault && "kind" in fault && fault.kind === kind ? (fault.next + 1) % count : 0;
  fault = { kind, next, count };
  show(null);
  ask({ type: "faults", fault: { kind, chosen: next } });
}

// To what the certificate's words name.
function flyTo(place: string, ids: number[]) {
  fault = { place };
  show(null);
  ask({ type: "faults", fault: { ids } });
}

function leaveFault() {
  if (fault) ask({ type: "faults", fault: null });
  fault = null;
  at("fault").hidden = true;
}
at("fault-next").onclick = () => fault && "kind" in fault && fly(fault.kind, fault.count);
at("fault-leave").onclick = leaveFault;

// --- what the worker says

function drawFacts() {
  if (!mesh) return at("facts").replaceChildren();
  const facts = at("facts");
  const fact = (name: string, value: string) => {
    const item = element("span", "", `${name} `);
    item.append(element("b", "", value));
    return item;
  };
  const items: HTMLElement[] = [
    element("b", "", mesh.label || shortName(mesh.name)),
    badgeOf(mesh),
    fact("dimension", `${mesh.k} in R${superscript(mesh.d)}`),
    fact("epsilon", `${Number(mesh.epsilon.toPrecision(4))}`),
    fact("vertices", grouped(mesh.vertices)),
    fact("simplices", grouped(mesh.simplices)),
    fact("queries", grouped(mesh.queries)),
    fact("round", grouped(mesh.round)),
  ];
  if (boundary) items.push(fact("boundary", boundary));
  if (mesh.elapsed > 0) items.push(fact("time", seconds(mesh.elapsed)));
  if (!mesh.over && mesh.remaining > 0) items.push(fact("left, about", seconds(mesh.remaining)));
  if (!mesh.over) items.push(fact("phase", mesh.phase));
  facts.replaceChildren(...items);
  document.title = `${mesh.label || shortName(mesh.name)} – Stellate`;
}

// Histograms take a while: of what stands still, and of what grows now and then.
setInterval(() => {
  const due = measured.revision !== shownRevision || measured.name !== chosen;
  if (!due || shownRevision === 0 || document.hidden) return;
  measured = { revision: shownRevision, name: chosen };
  ask({ type: "measure" });
}, 1000);

const hear: { [T in FromWorker["type"]]: (m: Extract<FromWorker, { type: T }>) => void } = {
  greeting: ({ server, mesh: name, secret: kept }) => {
    at("server").textContent = server;
    // So that the page can be loaded again.
    if (kept) history.replaceState(null, "", `#${[kept, mode].filter(Boolean).join("&")}`);
    if (name) choose(name);
  },
  connection: ({ ok, message }) => {
    at("connection").className = ok ? "" : "lost";
    at("connection").textContent = ok ? "" : `Not connected: ${message}. Trying again.`;
  },
  list: ({ meshes }) => {
    list = meshes;
    drawList(at("list"), list, chosen, chooseByHand);
    const newestMesh = meshes.at(-1);
    if (!chosen && newestMesh) choose(newestMesh.name);
    if (!chosen) note("No mesh yet");
    const looking = !following || fault !== null || replay !== undefined; // at something of this one
    if (led && !looking && newestMesh && mesh?.over && newestMesh.name !== chosen) {
      choose(newestMesh.name);
    }
  },
  mesh: (message) => {
    const first = mesh === null;
    mesh = message.mesh;
    if (first) meet(mesh);
    drawFacts();
    drawTime();
  },
  past: ({ rows }) => {
    past = rows;
    curves.show(rows);
    drawTime();
  },
  crew: ({ rows }) => drawCrew(at("crew"), rows),
  verdict: ({ verdict }) => drawVerdict(at("verdict"), verdict, fly, flyTo),
  histograms: ({ histograms }) => drawHistograms(at("histograms"), histograms),
  fly: ({ centre, radius, normal, level, text }) => {
    if (!fault) return;
    at("fault").hidden = false;
    at("fault").querySelector("span")!.textContent =
      "kind" in fault
        ? `${fault.next + 1} of ${fault.count}: ${kFaults[fault.kind]} ${text}`
        : fault.place;
    at("fault-next").hidden = !("kind" in fault) || fault.count < 2;
    if (!at("level-box").hidden) {
      at<HTMLInputElement>("level").value = `${level}`;
      changeLook({ level });
    }
    view.flyTo(centre, radius, normal);
  },
  loading: ({ text }) => {
    at("revision-text").textContent = text;
  },
  scene: (scene) => {
    shownRevision = scene.revision;
    at("note").hidden = scene.vertices > 0;
    if (!view.draws) note(kCannotDraw);
    at("revision-text").textContent =
      `revision ${scene.revision} of ${newest()} · ${grouped(scene.vertices)} vertices`;
    at("stage").dataset.revision = `${scene.revision}`;
    at("stage").dataset.vertices = `${scene.vertices}`;
    at("stage").dataset.simplices = `${scene.simplices}`;
    if (boundary !== scene.boundary) {
      boundary = scene.boundary;
      drawFacts();
    }
    view.show(scene, css("--mesh"), css("--text"));
  },
};
view.onDrawn = () => ask({ type: "drawn" });
worker.onmessage = ({ data }: MessageEvent<FromWorker>) => {
  if (data.of !== undefined && data.of !== chosen) return; // it was on its way when another was chosen
  (hear[data.type] as (message: FromWorker) => void)(data);
};
worker.onerror = (event) => {
  at("connection").className = "lost";
  at("connection").textContent = `The page has failed: ${event.message}`;
};

// --- the beginning

const setColours = () => view.setBackground(css("--stage"));
setColours();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", setColours);

const [secret, mode] = location.hash.slice(1).split("&");
const demo = (led = mode === "demo");
const recording = at("recording").textContent?.trim();
if (recording) {
  recorded = true;
  document.body.classList.add("recorded");
  ask({ type: "replay", recording: JSON.parse(recording) as Recording });
} else if (!secret) {
  note("Open the address that `stellate view` printed, with all that follows #.");
} else if (!globalThis.crypto?.subtle) {
  note("Open this page as http://127.0.0.1 or http://localhost.");
} else {
  ask({ type: "open", host: location.host, secret });
}
