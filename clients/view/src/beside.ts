// Another mesh beside the one that is chosen: seen from the same side, by the same look where it has one.
import { choicesOf } from "./choices";
import type { Look } from "./look";
import type { FromWorker, MeshRow, Told, ToWorker } from "./messages";
import { Overlay } from "./overlay";
import { badgeOf, element, grouped, shortName } from "./panels";
import { View } from "./scene";
import MeshWorker from "./worker?worker&inline";
import { at, css } from "./page";

export const overlayOn = (id: string) =>
  new Overlay(document.querySelector<SVGSVGElement>(`#${id}`)!, () => ({
    text: css("--text"),
    line: css("--dim"),
    ground: css("--stage"),
  }));

// How another mesh is looked at, which has these dimensions.
type Wish = { look: Look } & Pick<MeshRow, "k" | "d">;

// What a mesh can be looked at by, of what another is.
function lookOf(row: MeshRow, wish: Wish | null): Look {
  const { first, parts, colours } = choicesOf(row);
  if (wish === null || wish.k !== row.k || wish.d !== row.d) return first;
  const has = (options: [string, string][], value: string) => options.some(([v]) => v === value);
  const { part, colour, colourAxis } = wish.look;
  return {
    ...wish.look,
    part: has(parts, part) ? part : first.part,
    colour: has(colours, colour === "coordinate" ? `${colourAxis}` : colour) ? colour : "plain",
  };
}

export class Beside {
  name = ""; // of the mesh; empty: there is none
  private worker: Worker | null = null;
  private view: View | null = null;
  private row: MeshRow | null = null;
  private wish: Wish | null = null; // as of the mesh that is chosen
  private look: Look | null = null;
  private asked = 0;
  private drawn = 0;
  private readonly overlay = overlayOn("beside-overlay");

  // `open`: what a worker begins with. `onBusy`: it is, or is no longer.
  constructor(
    private readonly first: View,
    private readonly open: () => Told,
    private readonly onBusy: () => void,
  ) {
    at<HTMLSelectElement>("beside").onchange = (e) =>
      this.show((e.target as HTMLSelectElement).value);
  }

  get busy(): boolean {
    return this.name !== "" && (this.asked !== this.drawn || (this.view?.busy ?? false));
  }

  // Which there are to choose from; one that is gone is no longer shown.
  offer(list: MeshRow[], chosen: string) {
    const others = list.filter(({ name }) => name !== chosen);
    if (this.name && !others.some(({ name }) => name === this.name)) this.show("");
    at("beside-box").hidden = others.length === 0;
    const select = at<HTMLSelectElement>("beside");
    const options = others.map((row) => [row.name, row.label || shortName(row.name)]).reverse();
    const known = JSON.stringify(options);
    if (select.dataset.known !== known) {
      select.dataset.known = known;
      select.replaceChildren(
        new Option("nothing", ""),
        ...options.map(([value, text]) => new Option(text, value)),
      );
    }
    select.value = this.name;
  }

  show(name: string) {
    this.name = name;
    this.worker?.terminate();
    this.worker = this.row = this.look = null;
    this.asked = this.drawn = 0;
    at("stage").classList.toggle("two", name !== "");
    at("beside-stage").hidden = name === "";
    if (name === "") return this.onBusy();
    this.view ??= this.begin();
    this.view.clear();
    at("beside-facts").replaceChildren();
    this.worker = new MeshWorker();
    this.worker.onmessage = ({ data }: MessageEvent<FromWorker>) => this.hear(data);
    this.say(this.open());
    this.see({ type: "watch", name });
  }

  private begin(): View {
    const view = new View(at<HTMLCanvasElement>("beside-canvas"), at("look"));
    view.onBusy = this.onBusy;
    view.onFrame = (sight) => this.overlay.draw(sight);
    view.follows = true;
    view.onMoved = () => this.name && this.first.stand(view.stance);
    this.first.onMoved = () => this.name && view.stand(this.first.stance);
    view.onDrawn = ({ asked }) => {
      this.drawn = asked;
      this.say({ type: "drawn" });
      this.onBusy();
    };
    return view;
  }

  private say(message: ToWorker) {
    this.worker?.postMessage(message);
  }
  private see(message: Told) {
    this.say({ ...message, asked: ++this.asked });
    this.onBusy();
  }

  lookBy(wish: Wish) {
    this.wish = wish;
    this.view?.setBackground(css("--stage"));
    if (this.row === null) return;
    this.look = lookOf(this.row, wish);
    this.see({ type: "look", name: this.name, look: this.look });
  }

  setWires(on: boolean) {
    this.view?.setWires(on);
  }

  private hear(message: FromWorker) {
    if (message.type === "mesh") {
      const isFirst = this.row === null;
      this.row = message.mesh;
      if (isFirst) this.meet(message.mesh);
      this.drawFacts(message.mesh);
    } else if (message.type === "scene" && this.look && this.view) {
      const curve = this.row?.k === 1;
      this.view.show(message, css(curve ? "--curve" : "--mesh"), css("--text"), curve);
      const scaled = this.row?.scaled ?? false;
      this.overlay.show(this.look.frame, { name: "", scale: message.scale, scaled });
    }
  }

  private meet(row: MeshRow) {
    this.view?.standIn(row.d);
    this.view?.stand(this.first.stance);
    this.look = lookOf(row, this.wish);
    this.view?.setBackground(css("--stage"));
    this.see({ type: "look", name: this.name, look: this.look });
  }

  private drawFacts(row: MeshRow) {
    at("beside-facts").replaceChildren(
      element("b", "", row.label || shortName(row.name)),
      badgeOf(row),
      element("span", "", `${grouped(row.vertices)} vertices, ${grouped(row.simplices)} simplices`),
    );
  }
}
