// The picture by keyboard, for those who have no mouse, or do not see it move.
import type { View } from "./scene";

const kTurn = Math.PI / 24; // a press
const kNearer = 1.15;

const kKeys: Record<string, (view: View) => void> = {
  ArrowLeft: (view) => view.turn(-kTurn, 0),
  ArrowRight: (view) => view.turn(kTurn, 0),
  ArrowUp: (view) => view.turn(0, -kTurn),
  ArrowDown: (view) => view.turn(0, kTurn),
  "+": (view) => view.approach(1 / kNearer),
  "=": (view) => view.approach(1 / kNearer),
  "-": (view) => view.approach(kNearer),
  "0": (view) => view.refit(),
};

export function listenToKeys(canvas: HTMLElement, view: View) {
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const act = kKeys[event.key];
    if (act === undefined) return;
    event.preventDefault();
    act(view);
  });
}
