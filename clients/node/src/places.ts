// What became of the points of a reconstruction, as the parts of a download say it.
import type { Places__Output } from "./generated/stellate/v1/Places.js";
import { enumName, numbers, PLACES } from "./wire.js";

export class Places {
  private readonly codes: number[] = [];
  private readonly positions: number[] = [];

  add(part: Places__Output, d: number): void {
    this.codes.push(...part.codes);
    if (part.smoothed) this.positions.push(...numbers(part.smoothed, part.codes.length, d));
  }

  names(points: number): string[] | undefined {
    if (points === 0 || this.codes.length !== points) return undefined;
    return this.codes.map((code) => enumName(PLACES.get(code) ?? code, "PLACE_"));
  }

  smoothed(numbers: number): Float64Array | undefined {
    return numbers > 0 && this.positions.length === numbers
      ? Float64Array.from(this.positions)
      : undefined;
  }
}
