// What can be looked at of a mesh of some kind, and what is best seen of it at first.
import { axesFrame, Tour, type Look, type Part } from "./look";
import type { MeshRow } from "./messages";

const kObliqueSeconds = 4; // into a tour

export type Option = [value: string, text: string];

const subscript = (n: number) => `${n}`.replace(/\d/g, (digit) => "₀₁₂₃₄₅₆₇₈₉"[Number(digit)]);

export const coordinateName = (i: number) => `x${subscript(i + 1)}`;

export const coordinates = (d: number): Option[] =>
  Array.from({ length: d }, (_, i) => [`${i}`, coordinateName(i)]);

export interface Choices {
  parts: Option[];
  colours: Option[];
  first: Look;
  oblique: boolean; // the first look is along no axes of the coordinates
}

function partsOf(k: number, solid: boolean): Option[] {
  if (k === 1) return [["whole", "all of it"]];
  if (k === 2) {
    return [
      ["whole", "all of it"],
      ["cut", "cut open"],
      ["below", "a part"],
      ["slice", "a slice"],
    ];
  }
  if (k > 3) {
    return [
      ["slice", "a slice"],
      ["whole", "all edges"],
    ];
  }
  return [
    ...(solid
      ? ([
          ["boundary", "the boundary"],
          ["cut", "cut open"],
        ] as Option[])
      : []),
    ["slice", "a slice"],
    ["below", solid ? "a part" : "a shell"],
    ["whole", "all edges"],
  ];
}

export function choicesOf({ k, d, walls, regions, boundaryOnly, places }: MeshRow): Choices {
  const solid = k === 3 && walls > 0 && !boundaryOnly;
  const several = regions.length > 1;
  const parts = partsOf(k, solid);
  const colours: Option[] = [
    ["plain", "plain"],
    ...(several ? [["region", "region"] as Option] : []),
    ...(solid || boundaryOnly ? [["wall", "wall"] as Option] : []),
    ...(places.length > 0 ? [["place", "what became of it"] as Option] : []),
    ["order", "order of coming"],
    ["size", "circumradius"],
    ...(k > 1 ? [["shape", "thinness"] as Option] : []),
    ...coordinates(d),
  ];
  // What lies over itself when coordinates are left out does so less from an oblique side.
  // Of several regions those inside are to be seen, too.
  const part: Part = several && solid ? "cut" : (parts[0][0] as Part);
  const axis = Math.min(3, d - 1); // along an axis of the picture a slice would be seen edge on
  const seen = part === "slice" ? d - 1 : d; // dimensions of what holds what is seen
  const oblique = seen > 3;
  const axes = axesFrame(d, [0, 1, 2]);
  const still = part === "slice" ? [axis] : [];
  // Not by the coordinate that is the same all over a slice.
  const colourAxis = Math.min(part === "slice" ? axis + 1 : 3, d - 1);
  const first: Look = {
    frame: oblique ? new Tour(d, axes, still).at(kObliqueSeconds) : axes,
    part,
    axis,
    level: 0.5,
    colour: several
      ? "region"
      : solid || boundaryOnly
        ? "wall"
        : places.some((place) => place > 0)
          ? "place"
          : oblique
            ? "coordinate"
            : "plain",
    colourAxis,
  };
  return { parts, colours, first, oblique };
}
