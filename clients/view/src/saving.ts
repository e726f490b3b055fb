// Files of what is on the screen: the picture, with its axes and legends, and the mesh.
import { formatsOf } from "./formats";
import type { Format, MeshRow } from "./messages";

export function offer(name: string, file: Blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(file);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

// A file's name of a label, which may hold anything.
export function fileName({ label }: Pick<MeshRow, "label">, end: string): string {
  const plain = label
    .normalize("NFKD")
    .replace(/[^\w.-]+/g, "-")
    .replace(/^[-.]+|[-.]+$/g, "");
  return `${plain.slice(0, 60) || "mesh"}.${end}`;
}

export function saves({ k, d }: MeshRow): [value: string, text: string][] {
  const mesh = formatsOf(k, d).map((format): [Format, string] => [format, `mesh, .${format}`]);
  return [["", "save"], ["png", "picture, .png"], ...mesh];
}

async function imageOf(svg: SVGSVGElement): Promise<HTMLImageElement> {
  const image = new Image();
  const text = new XMLSerializer().serializeToString(svg);
  image.src = `data:image/svg+xml,${encodeURIComponent(text)}`;
  await image.decode();
  return image;
}

function drawLegend(brush: CanvasRenderingContext2D, legend: HTMLElement, width: number) {
  brush.font = "12px system-ui, 'DejaVu Sans', sans-serif";
  const items = ([...legend.children] as HTMLElement[]).reverse();
  let right = width - 14;
  for (const item of items) {
    const text = item.textContent ?? "";
    right -= brush.measureText(text).width;
    brush.fillStyle = getComputedStyle(legend).color;
    brush.fillText(text, right, 24);
    brush.fillStyle = item.style.getPropertyValue("--swatch");
    brush.fillRect(right - 15, 15, 9, 9);
    right -= 27;
  }
}

// As it is seen, without the tools.
export async function pictureOf(
  canvas: HTMLCanvasElement,
  overlay: SVGSVGElement,
  legend: HTMLElement,
): Promise<Blob> {
  const picture = document.createElement("canvas");
  [picture.width, picture.height] = [canvas.width, canvas.height];
  const brush = picture.getContext("2d")!;
  brush.drawImage(canvas, 0, 0);
  brush.scale(canvas.width / canvas.clientWidth, canvas.height / canvas.clientHeight);
  brush.drawImage(await imageOf(overlay), 0, 0);
  if (!legend.hidden) drawLegend(brush, legend, canvas.clientWidth);
  return new Promise((resolve, reject) =>
    picture.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture"))), "image/png"),
  );
}
