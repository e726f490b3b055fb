// The page: what is chosen, and what of it is shown where.
import "./style.css";
import "./stage.css";
import { Beside, overlayOn } from "./beside";
import { Curves, Histograms } from "./charts";
import { choicesOf, coordinateName, coordinates } from "./choices";
import { Inspector } from "./inspector";
import { listenToKeys } from "./keys";
import { axesFrame, Tour, type Colour, type Look, type Part } from "./look";
import type { FaultKind, Format, FromWorker, MeshRow, Told, ToWorker } from "./messages";
import {
  badgeOf,
  drawWorkers,
  drawList,
  drawVerdict,
  drawLegend,
  element,
  grouped,
  seconds,
  shortName,
  superscript,
} from "./panels";
import { Leader } from "./leader";
import { fileName, offer, pictureOf, saves } from "./saving";
import { View } from "./scene";
import type { Recording } from "./source";
import { Time } from "./time";
import MeshWorker from "./worker?worker&inline";
import { at, css } from "./page";

const kTourSeconds = 0.05;

const kFaults: { [K in FaultKind]: string } = {
  faces: "the face of",
  links: "the link of",
  stars: "the star of",
  inconsistent: "the star of",
  fibres: "a normal flat near",
};

const kEnded: Record<string, string> = {
  stopped: "was stopped",
  cancelled: "was cancelled",
  failed: "failed",
};

const kNothingHere = "Nothing of it is at this level";
const kNothingYet = "It had no vertex yet at this revision";
const kCannotDraw =
  "This browser cannot draw the mesh: it has no WebGL, or WebGL is switched off in its settings. " +
  "Certificate and figures are beside this.";

const worker = new MeshWorker();
const ask = (message: ToWorker) => worker.postMessage(message);
let asked = 0; // times that something else was to be seen
let drawn = 0; // the last of them that is on the screen

// What changes the picture.
function askToSee(message: Told): number {
  ask({ ...message, asked: ++asked });
  tellBusy();
  return asked;
}

const view = new View(at<HTMLCanvasElement>("canvas"), at("look"));
view.onBusy = tellBusy;
listenToKeys(at("canvas"), view);
const overlay = overlayOn("overlay");
view.onFrame = (sight) => overlay.draw(sight);
const inspector = new Inspector(at<HTMLCanvasElement>("canvas"), view, ask, askToSee);

// Whether something else is about to be seen.
function tellBusy() {
  at("stage").setAttribute("aria-busy", `${view.busy || asked !== drawn || beside.busy}`);
}

const beside = new Beside(
  view,
  () => ({ type: "open", host: location.host, secret: secretNow(), lists: false }),
  tellBusy,
);

let chosen = "";
let recorded = false;
let list: MeshRow[] = [];
let mesh: MeshRow | null = null;
let gone = false; // it was deleted, or its time was over
let boundary = ""; // of what is shown, in words
let fault: { kind: FaultKind; next: number; count: number } | { place: string } | null = null;
let look: Look = {
  frame: axesFrame(3, [0, 1, 2]),
  part: "whole",
  axis: 0,
  level: 0.5,
  colour: "plain",
  colourAxis: 0,
};
let tour: { tour: Tour; start: number } | null = null;
let measured = { revision: -1, name: "" };

const time = new Time(
  (revision) => askToSee({ type: "revision", revision }),
  () => drawn,
  () => !recorded,
);
const [, mode] = location.hash.slice(1).split("&");
const demo = mode === "demo";
const leader = new Leader(demo, time, () => {
  const next = list[list.findIndex(({ name }) => name === chosen) + 1];
  if (next && fault === null) choose(next.name);
});
const histograms = new Histograms(at("histograms"));
const curves = new Curves(at("curves"), at("legend"), (revision) => time.show(revision));

// What the page was opened with holds but once: another takes its place.
function secretNow(): string {
  return location.hash.slice(1).split("&")[0];
}

function note(text: string) {
  at("note").hidden = false;
  at("note").textContent = text;
}

// Why there is nothing of it yet, or ever.
function emptyOf(row: MeshRow | null): string {
  if (row?.over && row.vertices === 0) {
    return `It ${kEnded[row.state] ?? "ended"} before its first vertex`;
  }
  return `Waiting for the first vertices${row?.state === "waiting" ? ": no worker serves it" : ""}`;
}

function choose(name: string) {
  if (name === chosen) return;
  chosen = name;
  mesh = null;
  gone = false;
  leaveFault();
  stopTour();
  inspector.reset();
  time.reset();
  leader.reset();
  boundary = "";
  measured = { revision: -1, name: "" };
  histograms.show([]);
  Object.assign(at("stage").dataset, { revision: "0", vertices: "0", simplices: "0" });
  note(emptyOf(null));
  view.clear();
  drawList(at("list"), list, chosen, chooseByHand);
  beside.offer(list, chosen);
  askToSee({ type: "watch", name });
}

function chooseByHand(name: string) {
  leader.leads = demo && name === list.at(-1)?.name;
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
  const { parts, first, oblique } = choicesOf(row);
  look = first;
  stopTour();
  view.standIn(row.d);
  at("look").hidden = at("right").hidden = false;
  at<HTMLInputElement>("level").value = "0.5";
  fill("part", parts, look.part);
  at("part-box").hidden = parts.length === 1;
  at("wires-box").hidden = row.k === 1;
  fill("axis", coordinates(row.d), `${look.axis}`);
  fillColours(row);
  fill("save", saves(row), "");
  [0, 1, 2].forEach((axis) =>
    fill(
      `axis-${axis}`,
      [["", "oblique"], ...coordinates(row.d)],
      oblique || axis >= row.d ? "" : `${axis}`,
    ),
  );
  at("axes-box").hidden = row.d <= 3;
  setParts();
  askToSee({ type: "look", name: chosen, look });
  beside.lookBy({ look, k: row.k, d: row.d });
  // From one side alone, what has more dimensions lies over itself.
  if (row.d > 3 && !matchMedia("(prefers-reduced-motion: reduce)").matches) startTour();
}

// What the colour map says.
function colourName(): string {
  if (look.colour === "coordinate") return coordinateName(look.colourAxis);
  return at<HTMLSelectElement>("colour").selectedOptions[0]?.textContent ?? "";
}

function startTour() {
  if (mesh === null) return;
  const still = look.part === "slice" ? [look.axis] : []; // or it would be seen edge on
  tour = { tour: new Tour(mesh.d, look.frame, still), start: performance.now() };
  at<HTMLInputElement>("tour").checked = true;
  for (const id of ["axis-0", "axis-1", "axis-2"]) at<HTMLSelectElement>(id).value = "";
}

function stopTour() {
  tour = null;
  at<HTMLInputElement>("tour").checked = false;
}

// What it can be coloured by, of which there is more once it is over.
function fillColours(row: MeshRow) {
  const { colour, colourAxis } = look;
  fill("colour", choicesOf(row).colours, colour === "coordinate" ? `${colourAxis}` : colour);
  drawLegend(at("walls"), row, look);
}

function setParts() {
  if (mesh) drawLegend(at("walls"), mesh, look);
  const whole = look.part === "whole" || look.part === "boundary";
  at("axis-box").hidden = at("level-box").hidden = whole;
}

function changeLook(change: Partial<Look>) {
  if (mesh === null) return; // there is nothing to look at yet, and its first look comes with it
  look = { ...look, ...change };
  if (tour && (change.part !== undefined || change.axis !== undefined)) startTour();
  setParts();
  askToSee({ type: "look", name: chosen, look });
  beside.lookBy({ look, k: mesh.k, d: mesh.d });
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
  if ((e.target as HTMLInputElement).checked) startTour();
  else stopTour();
};
at<HTMLInputElement>("wires").onchange = (e) => {
  const on = (e.target as HTMLInputElement).checked;
  view.setWires(on);
  beside.setWires(on);
};
at("fit").onclick = () => view.refit();
at<HTMLSelectElement>("save").onchange = (e) => {
  const select = e.target as HTMLSelectElement;
  const wish = select.value;
  select.value = "";
  if (wish === "png") void savePicture();
  else ask({ type: "save", format: wish as Format });
};
async function savePicture() {
  if (mesh === null) return;
  const svg = document.querySelector<SVGSVGElement>("#overlay")!;
  const name = fileName(mesh, "png");
  offer(name, await pictureOf(at<HTMLCanvasElement>("canvas"), svg, at("walls")));
}
setInterval(() => {
  if (tour && !document.hidden) {
    changeLook({ frame: tour.tour.at((performance.now() - tour.start) / 1000) });
  }
}, 1000 * kTourSeconds);

// --- faults

function fly(kind: FaultKind, count: number) {
  const next = fault && "kind" in fault && fault.kind === kind ? (fault.next + 1) % count : 0;
  fault = { kind, next, count };
  time.show(null);
  askToSee({ type: "faults", fault: { kind, chosen: next } });
}

// To what the certificate's words name.
function flyTo(place: string, ids: number[]) {
  fault = { place };
  time.show(null);
  askToSee({ type: "faults", fault: { ids } });
}

function leaveFault() {
  if (fault) askToSee({ type: "faults", fault: null });
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
    gone ? element("span", "badge bad", "no longer on the server") : badgeOf(mesh),
    fact("dimension", `${mesh.k} in R${superscript(mesh.d)}`),
    ...(mesh.ofPoints ? [] : [fact("epsilon", `${Number(mesh.epsilon.toPrecision(4))}`)]),
    fact("vertices", grouped(mesh.vertices)),
    fact("simplices", grouped(mesh.simplices)),
    ...(mesh.ofPoints ? [] : [fact("queries", grouped(mesh.queries))]),
    fact("round", grouped(mesh.round)),
  ];
  if (boundary) items.push(fact("boundary", boundary));
  if (mesh.elapsed > 0) items.push(fact("time", seconds(mesh.elapsed)));
  if (!mesh.over && mesh.remaining > 0) items.push(fact("left, about", seconds(mesh.remaining)));
  if (!mesh.over) items.push(fact("phase", mesh.phase));
  facts.replaceChildren(...items);
  at("canvas").setAttribute("aria-label", items.map((item) => item.textContent).join(", "));
  document.title = `${mesh.label || shortName(mesh.name)} – Stellate`;
}

// Histograms take a while: of what stands still, and of what grows now and then.
setInterval(() => {
  const due = measured.revision !== time.shown || measured.name !== chosen;
  if (!due || time.shown === 0 || document.hidden) return;
  measured = { revision: time.shown, name: chosen };
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
    const had = list.some(({ name }) => name === chosen);
    const has = meshes.some(({ name }) => name === chosen);
    if (had !== has) {
      gone = had;
      drawFacts();
    }
    list = meshes;
    drawList(at("list"), list, chosen, chooseByHand);
    beside.offer(list, chosen);
    const first = meshes.at(leader.leads ? 0 : -1);
    if (!chosen && first) choose(first.name);
    if (!chosen) note("No mesh yet");
  },
  mesh: (message) => {
    const before = mesh;
    mesh = message.mesh;
    if (before === null) meet(mesh);
    else if (before.places.length !== mesh.places.length) fillColours(mesh);
    drawFacts();
    time.hear(mesh.revision, mesh.over);
    leader.hear(mesh);
    if (time.shown === 0) note(emptyOf(mesh));
  },
  past: ({ rows }) => {
    curves.show(mesh?.ofPoints ? [] : rows); // no rule is asked of points
    time.hear(rows.at(-1)?.revision ?? 0);
  },
  workers: ({ rows }) => {
    at("workers-box").hidden = rows.length === 0 && (mesh?.over ?? true);
    drawWorkers(at("workers"), rows);
  },
  verdict: ({ verdict }) => drawVerdict(at("verdict"), verdict, fly, flyTo),
  histograms: (message) => histograms.show(message.histograms),
  found: ({ found, pin }) => inspector.hear(found, pin),
  saved: ({ format, file, message }) => {
    if (file && mesh) offer(fileName(mesh, format), file);
    else at("revision-text").textContent = message;
  },
  fly: ({ centre, radius, normal, level, text, found }) => {
    if (found) return view.flyTo(centre, radius, normal);
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
    if (boundary !== scene.boundary) {
      boundary = scene.boundary;
      drawFacts();
    }
    const plain = css(mesh?.k === 1 ? "--curve" : "--mesh");
    view.show(scene, plain, css("--text"), mesh?.k === 1);
    const scaled = mesh?.scaled ?? false;
    overlay.show(look.frame, { name: colourName(), scale: scene.scale, scaled });
  },
};
view.onDrawn = (scene) => {
  const { revision, vertices, simplices } = scene;
  leader.arrived(revision);
  time.arrived(revision, vertices);
  at("note").hidden = true;
  if (!scene.drawn)
    note(vertices > 0 ? kNothingHere : time.following ? emptyOf(mesh) : kNothingYet);
  if (!view.draws) note(kCannotDraw);
  Object.assign(at("stage").dataset, { revision, vertices, simplices });
  drawn = scene.asked;
  ask({ type: "drawn" });
};
worker.onmessage = ({ data }: MessageEvent<FromWorker>) => {
  if (data.of !== undefined && data.of !== chosen) return; // it was on its way when another was chosen
  (hear[data.type] as (message: FromWorker) => void)(data);
};
worker.onerror = (event) => {
  at("connection").className = "lost";
  at("connection").textContent = `The page has failed: ${event.message}`;
};

// --- the beginning

function setColours() {
  view.setBackground(css("--stage"));
  changeLook({}); // drawn again, with the new ones
}
setColours();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", setColours);

const recording = at("recording").textContent?.trim();
if (recording) {
  recorded = true;
  document.body.classList.add("recorded");
  ask({ type: "replay", recording: JSON.parse(recording) as Recording });
} else if (!secretNow()) {
  note("Open the address that `stellate view` printed, with all that follows #.");
} else if (!globalThis.crypto?.subtle) {
  note("Open this page as http://127.0.0.1 or http://localhost.");
} else {
  ask({ type: "open", host: location.host, secret: secretNow(), lists: true });
}
