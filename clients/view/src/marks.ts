// What is drawn over a mesh: lines of some pixels' width, round dots.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DataTexture,
  LinearFilter,
  Points,
  PointsMaterial,
  RGBAFormat,
} from "three";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/examples/jsm/lines/LineSegmentsGeometry.js";

export class ThickLines {
  readonly object: LineSegments2;
  private readonly material: LineMaterial;

  // `through`: seen through what stands before them. Without a colour, each has its own.
  constructor({ width, colour, through }: { width: number; colour?: string; through?: boolean }) {
    this.material = new LineMaterial({
      linewidth: width,
      color: colour ?? "#ffffff",
      vertexColors: colour === undefined,
      depthTest: !through,
      transparent: through ?? false, // drawn after the mesh
    });
    this.object = new LineSegments2(new LineSegmentsGeometry(), this.material);
    this.object.visible = false;
    this.object.frustumCulled = false;
  }

  // Pairs of positions; a colour for each pair, or red, green and blue, 0..1, for each position.
  show(positions: Float32Array, colours: string[] | Float32Array = []) {
    this.object.visible = positions.length > 0;
    if (positions.length === 0) return;
    this.object.geometry.dispose();
    this.object.geometry = new LineSegmentsGeometry();
    this.object.geometry.setPositions(positions);
    if (!this.material.vertexColors) return;
    const ofPair = (name: string) => {
      const { r, g, b } = new Color(name);
      return [r, g, b, r, g, b];
    };
    const all = colours instanceof Float32Array ? colours : colours.flatMap(ofPair);
    this.object.geometry.setColors(all);
  }
}

function disc(): DataTexture {
  const size = 32;
  const pixels = new Uint8Array(4 * size * size).fill(255);
  for (let i = 0; i < size * size; i++) {
    const away = Math.hypot((i % size) + 0.5 - size / 2, Math.floor(i / size) + 0.5 - size / 2);
    pixels[4 * i + 3] = 255 * Math.min(Math.max(size / 2 - away, 0), 1);
  }
  const texture = new DataTexture(pixels, size, size, RGBAFormat);
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

export class Dots {
  readonly object: Points<BufferGeometry, PointsMaterial>;

  // `each`: has its own colour.
  constructor({
    size,
    colour,
    through,
    each,
  }: {
    size: number;
    colour?: string;
    through?: boolean;
    each?: boolean;
  }) {
    this.object = new Points(
      new BufferGeometry(),
      new PointsMaterial({
        size: size * Math.min(window.devicePixelRatio, 2),
        color: colour ?? "#ffffff",
        vertexColors: each ?? false,
        map: disc(),
        alphaTest: 0.5,
        sizeAttenuation: false,
        depthTest: !through,
        transparent: through ?? false,
      }),
    );
    this.object.visible = false;
    this.object.frustumCulled = false;
  }

  // A colour of all, or three bytes of each.
  show(positions: Float32Array, colour?: string | Uint8Array) {
    this.object.visible = positions.length > 0;
    this.object.geometry.dispose();
    this.object.geometry = new BufferGeometry();
    this.object.geometry.setAttribute("position", new BufferAttribute(positions, 3));
    if (colour instanceof Uint8Array) {
      this.object.geometry.setAttribute("color", new BufferAttribute(colour, 3, true));
    } else if (colour !== undefined) {
      this.object.material.color.set(colour);
    }
  }
}
