// Arrays as they travel: little-endian bytes, at any offset of a message.
import type { Array as WireArray, IndexArray } from "./generated/stellate/v1/geometry_pb";

export function doubles(array: WireArray | undefined): Float64Array {
  return array ? new Float64Array(array.data.slice().buffer) : new Float64Array();
}

export function indices(array: IndexArray | undefined): Uint32Array {
  return array ? new Uint32Array(array.data.slice().buffer) : new Uint32Array();
}
