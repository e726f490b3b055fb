// The lists beside the mesh. All text goes in as text: labels and titles are strangers'.
import { kPlaces, regionColour, wallColour, type Look } from "./look";
import type { Claim, WorkerRow, FaultKind, MeshRow, Verdict } from "./messages";

export function element<T extends keyof HTMLElementTagNameMap>(
  tag: T,
  className = "",
  text = "",
): HTMLElementTagNameMap[T] {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text) made.textContent = text;
  return made;
}

// Whoever reads, or is about to press, is left alone where there is nothing new.
const drawn = new WeakMap<HTMLElement, string>();
function isNews(host: HTMLElement, ...content: unknown[]): boolean {
  const now = JSON.stringify(content);
  if (drawn.get(host) === now) return false;
  drawn.set(host, now);
  return true;
}

export const grouped = (n: number) => Math.round(n).toLocaleString("en");

export function seconds(s: number): string {
  if (s < 1) return `${Number(s.toPrecision(1))} s`;
  if (s < 10) return `${s.toFixed(1)} s`;
  if (s < 120) return `${s.toFixed(0)} s`;
  return s < 7200 ? `${(s / 60).toFixed(0)} min` : `${(s / 3600).toFixed(1)} h`;
}

// A name is a key to the mesh: eight digits tell it from others.
export const shortName = (name: string) => name.replace("meshes/", "").slice(0, 8);

export function badgeOf(row: MeshRow): HTMLElement {
  const kind =
    row.certified === null
      ? row.state === "waiting"
        ? "waiting"
        : "running"
      : row.certified
        ? "good"
        : "bad";
  const text =
    row.certified === null
      ? row.state
      : row.certified
        ? "certified"
        : row.state === "succeeded"
          ? "not certified"
          : row.state;
  return element("span", `badge ${kind}`, text);
}

const lastChosen = new WeakMap<HTMLElement, string>();

export function drawList(
  host: HTMLElement,
  rows: MeshRow[],
  chosen: string,
  onChoose: (name: string) => void,
) {
  if (!isNews(host, rows, chosen)) return;
  const focused = document.activeElement?.getAttribute("data-name");
  host.replaceChildren(
    ...rows
      .slice()
      .reverse()
      .map((row) => {
        const item = element("button", "mesh");
        item.type = "button";
        item.dataset.name = row.name;
        item.setAttribute("aria-pressed", `${row.name === chosen}`);
        const title = element("span", "title", row.label || shortName(row.name));
        item.title = row.label;
        const facts = element(
          "span",
          "facts",
          `${row.k} in R${superscript(row.d)} · ${grouped(row.vertices)} vertices`,
        );
        item.append(title, facts, badgeOf(row));
        if (row.certified === null) {
          const bar = element("span", "bar");
          bar.style.setProperty("--share", `${row.fraction}`);
          item.append(bar);
        }
        item.onclick = () => onChoose(row.name);
        return item;
      }),
  );
  const pressed = host.querySelector('[aria-pressed="true"]');
  if (chosen !== lastChosen.get(host))
    pressed?.scrollIntoView({ block: "nearest", inline: "nearest" });
  lastChosen.set(host, chosen);
  if (focused) host.querySelector<HTMLElement>(`[data-name="${CSS.escape(focused)}"]`)?.focus();
  if (rows.length === 0) {
    host.append(
      element("p", "empty", "No mesh is on this server yet. One that is made shows here."),
    );
  }
}

export const superscript = (n: number) =>
  `${n}`.replace(/\d/g, (digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(digit)]);

export function drawWorkers(host: HTMLElement, rows: WorkerRow[]) {
  if (!isNews(host, rows)) return;
  const table = element("table");
  const head = table.createTHead().insertRow();
  for (const title of ["answered", "per second", "chunk", "unanswered"]) {
    head.append(element("th", "", title));
  }
  const body = table.createTBody();
  for (const row of rows) {
    const who = body.insertRow().insertCell();
    who.colSpan = head.cells.length;
    who.textContent = row.displayName;
    who.title = row.displayName;
    const line = body.insertRow();
    if (row.lagging) line.className = "lagging";
    for (const value of [
      grouped(row.queries),
      row.perSecond > 0 ? grouped(row.perSecond) : "–",
      grouped(row.newestChunk),
      row.lagging ? "lags" : grouped(row.unanswered),
    ]) {
      line.insertCell().textContent = value;
    }
  }
  host.replaceChildren(rows.length > 0 ? table : element("p", "empty", "No worker serves it."));
}

// What the colours are: of what is told by them, and of walls where there are curves of these.
export function drawLegend(host: HTMLElement, row: MeshRow, { colour, part }: Look) {
  const items: [text: string, colour: string][] = [];
  if (colour === "region") {
    items.push(...row.regions.map((r): [string, string] => [`region ${r}`, regionColour(r)]));
  } else if (colour === "place") {
    items.push(...row.places.map((p): [string, string] => [kPlaces[p].name, kPlaces[p].colour]));
  }
  const curves = row.k < 3 ? !row.boundaryOnly : row.k === 3 && part === "slice";
  for (let wall = 0; (curves || colour === "wall") && wall < row.walls; wall++) {
    items.push([`wall ${wall}`, wallColour(wall)]);
  }
  if (!isNews(host, items)) return;
  host.hidden = items.length === 0;
  host.replaceChildren(
    ...items.map(([text, swatch]) => {
      const item = element("span", "", text);
      item.style.setProperty("--swatch", swatch);
      return item;
    }),
  );
}

function drawClaim(claim: Claim, onFault: (kind: FaultKind, count: number) => void): HTMLElement {
  const item = element("li", claim.holds === null ? "number" : claim.holds ? "holds" : "fails");
  item.append(element("span", "name", claim.title));
  if (claim.faults === undefined) {
    item.append(element("span", "what", claim.text));
    return item;
  }
  const { faults, count } = claim;
  const link = element("button", "what fault", claim.text);
  link.type = "button";
  link.dataset.fault = faults;
  link.title = "Show the next";
  link.onclick = () => onFault(faults, count ?? 0);
  item.append(link);
  return item;
}

type OnPlace = (place: string, ids: number[]) => void;

// Words in which simplices and vertices that are named lead there.
function withPlaces(text: string, onPlace: OnPlace): (string | HTMLElement)[] {
  return text.split(/((?:simplex|face) \(\d+(?: \d+)*\)|vertex \d+)/i).map((part, i) => {
    if (i % 2 === 0) return part;
    const link = element("button", "place", part);
    link.type = "button";
    link.onclick = () => onPlace(part, part.match(/\d+/g)!.map(Number));
    return link;
  });
}

export function drawVerdict(
  host: HTMLElement,
  verdict: Verdict | null,
  onFault: (kind: FaultKind, count: number) => void,
  onPlace: OnPlace,
) {
  if (!isNews(host, verdict)) return;
  if (verdict === null) {
    host.replaceChildren(element("p", "empty", "The certificate comes with the mesh's end."));
    return;
  }
  const headline = element("p", `headline ${verdict.level}`, verdict.headline);
  const text = element("p", "verdict");
  text.append(...withPlaces(verdict.text, onPlace));
  const claims = element("ul", "claims");
  claims.append(...verdict.claims.map((claim) => drawClaim(claim, onFault)));
  host.replaceChildren(headline, text, claims);
  // What is cut off can be read.
  if (text.scrollHeight > text.clientHeight) {
    const more = element("button", "more", "read on");
    more.type = "button";
    more.onclick = () => {
      text.classList.add("open");
      more.remove();
    };
    text.after(more);
  }
  for (const warning of verdict.warnings) {
    const line = element("p", "warning");
    line.append(...withPlaces(warning, onPlace));
    host.append(line);
  }
}
