// What a vertex or a simplex is: by the pointer, as it rests or presses, or by number.
import type { Found, Told } from "./messages";
import { element } from "./panels";
import type { View } from "./scene";
import { at } from "./page";

const kRest = 0.08; // seconds
const kStill = 4; // pixels: further, and what was pressed was turned

function drawRows(host: HTMLElement, { rows }: Found) {
  host.replaceChildren(
    ...rows.flatMap(([name, text]) => [element("dt", "", name), element("dd", "", text)]),
  );
}

export class Inspector {
  private pointer = { x: 0, y: 0 };
  private rest: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly view: View,
    private readonly ask: (message: Told) => void,
    private readonly see: (message: Told) => void, // what changes the picture
  ) {
    let pressed: { x: number; y: number } | null = null;
    canvas.addEventListener("pointermove", ({ offsetX, offsetY, buttons }) => {
      this.pointer = { x: offsetX, y: offsetY };
      this.hide();
      if (buttons === 0) this.rest = setTimeout(() => this.pick(false), 1000 * kRest);
    });
    canvas.addEventListener("pointerleave", () => this.hide());
    canvas.addEventListener("wheel", () => this.hide(), { passive: true });
    canvas.addEventListener("pointerdown", ({ offsetX, offsetY, button }) => {
      this.hide();
      pressed = button === 0 ? { x: offsetX, y: offsetY } : null;
    });
    canvas.addEventListener("pointerup", ({ offsetX, offsetY }) => {
      if (!pressed || Math.hypot(offsetX - pressed.x, offsetY - pressed.y) > kStill) return;
      this.pointer = { x: offsetX, y: offsetY };
      this.pick(true);
    });
    at("find").onsubmit = (event) => {
      event.preventDefault();
      const ids = (at<HTMLInputElement>("find-ids").value.match(/\d+/g) ?? []).map(Number);
      if (ids.length > 0) this.see({ type: "find", ids });
    };
    at("unpin").onclick = () => this.see({ type: "find", ids: [] });
  }

  // Another mesh, or nothing.
  reset() {
    this.hide();
    at("found").hidden = true;
    at("find-none").hidden = true;
    at<HTMLInputElement>("find-ids").value = "";
  }

  hear(found: Found | null, pin: boolean) {
    if (!pin) return this.hint(found);
    const sought = at<HTMLInputElement>("find-ids");
    at("find-none").hidden = found !== null || document.activeElement !== sought;
    at("found").hidden = found === null;
    if (found === null) return;
    at("found-title").textContent = found.title;
    drawRows(at("found-rows"), found);
    sought.value = found.ids.join(" ");
    at("find-box").scrollIntoView({ block: "nearest" });
  }

  private hint(found: Found | null) {
    const hint = at("hint");
    hint.hidden = found === null;
    if (found === null) return;
    const { x, y } = this.pointer;
    const rows = element("dl");
    drawRows(rows, found);
    hint.replaceChildren(element("b", "", found.title), rows);
    // Beside the pointer, on the side where there is room.
    const { clientWidth: width, clientHeight: height } = this.canvas;
    hint.style.left = x < width / 2 ? `${x + 16}px` : "auto";
    hint.style.right = x < width / 2 ? "auto" : `${width - x + 16}px`;
    hint.style.top = y < height / 2 ? `${y + 12}px` : "auto";
    hint.style.bottom = y < height / 2 ? "auto" : `${height - y + 12}px`;
  }

  private hide() {
    clearTimeout(this.rest);
    at("hint").hidden = true;
  }

  private pick(pin: boolean) {
    const ray = this.view.rayAt(this.pointer.x, this.pointer.y);
    if (pin) this.see({ type: "pick", ray, pin });
    else this.ask({ type: "pick", ray, pin });
  }
}
