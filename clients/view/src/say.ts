// What the worker tells the page.
import type { FromWorker } from "./messages";
import type { CallEnd } from "./source";

export const send = (message: FromWorker, transfer: Transferable[] = []) =>
  (self as unknown as Worker).postMessage(message, transfer);

export function report(end: CallEnd) {
  send({ type: "connection", ok: end.code === 0, message: end.message });
}

export const sleep = (seconds: number) =>
  new Promise((resolve) => setTimeout(resolve, 1000 * seconds));
