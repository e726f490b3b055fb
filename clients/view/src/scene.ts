// The mesh on the screen.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DirectionalLight,
  DoubleSide,
  Group,
  HemisphereLight,
  Mesh,
  MeshStandardMaterial,
  PerspectiveCamera,
  Raycaster,
  Scene as ThreeScene,
  Spherical,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { kSeveral } from "./boundary";
import { Dots, ThickLines } from "./marks";
import { paletteColour, wallColour, type Shape } from "./look";
import type { Ray, Scene } from "./messages";
import { roughIndex } from "./rough";

// Viridis at a few places; between them straight.
export const kMap = ["#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#fde725"].map(
  (c) => new Color(c),
);
const kWhite = new Color("#ffffff");
const kSlowFrame = 0.08; // seconds: from here on, moving is drawn coarser
const kFlight = 0.6; // seconds
const kAside = new Vector3(1.4, -2.2, 1.3); // where one stands at first
const kAbove = new Vector3(0, -0.001, 1); // a plane is seen from straight above it

export function colourAt(value: number, out: Color): Color {
  const place = Math.min(Math.max(value, 0), 1) * (kMap.length - 1);
  const i = Math.min(Math.floor(place), kMap.length - 2);
  return out.lerpColors(kMap[i], kMap[i + 1], place - i);
}

// Whence a mesh is seen, in its own size: for another to be seen from there, too.
export interface Stance {
  eye: Vector3; // from the middle of the picture
  aside: Vector3; // where that is, from the middle of the mesh
}

// Whence the mesh is seen, for what is drawn over it.
export interface Sight {
  width: number; // pixels, as all of these
  height: number;
  bottom: number; // above what stands on the lower end
  pixels: number; // that a length of 1 has in the middle of the picture
  right: [number, number, number];
  up: [number, number, number];
  empty: boolean; // there is nothing
}

export class View {
  private readonly renderer: WebGLRenderer | null; // none where the browser has no WebGL
  private readonly scene = new ThreeScene();
  private readonly camera = new PerspectiveCamera(35, 1, 0.001, 1000);
  private readonly controls: OrbitControls;
  private readonly surface = new Mesh(
    new BufferGeometry(),
    new MeshStandardMaterial({
      side: DoubleSide,
      flatShading: true,
      vertexColors: true,
      roughness: 0.62,
      metalness: 0.05,
      polygonOffset: true,
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
    }),
  );
  private readonly rough = new Mesh(new BufferGeometry(), this.surface.material);
  private readonly wires = new Mesh(
    this.surface.geometry,
    new LineWires() as unknown as MeshStandardMaterial,
  );
  private readonly curve = new ThickLines({ width: 2.5 });
  private readonly net = new ThickLines({ width: 1 }); // of edges that are many
  private readonly rim = new ThickLines({ width: 3 });
  private readonly corners = new Dots({ size: 9, each: true });
  private readonly bare = new Dots({ size: 5, each: true });
  private readonly bareEdge = new Dots({ size: 7 }); // about each of them, that pale ones are seen
  private readonly faultEdges = new ThickLines({ width: 2.5, colour: "#d92d20", through: true });
  private readonly chosenEdges = new ThickLines({ width: 2.5, colour: "#ffb020", through: true });
  private readonly faults = new Dots({ size: 9, colour: "#d92d20", through: true });
  private readonly chosen = new Dots({ size: 15, colour: "#ffb020", through: true });
  private readonly pinnedEdges = new ThickLines({ width: 3, colour: "#e11d9c", through: true });
  private readonly pinned = new Dots({ size: 11, colour: "#e11d9c", through: true });
  private readonly all = new Group();
  private flat = false;
  private stood: Vector3 | null = null; // whence it was looked at, before flights that nobody ended by hand
  private dirty = true; // a frame is due
  private moving = false;
  private slow = 0; // seconds that all of the mesh takes to be drawn, lately
  private fitted = false;
  private below = 0; // pixels
  private ball = { centre: new Vector3(), radius: 1 };
  private flight: { from: [Vector3, Vector3]; to: [Vector3, Vector3]; start: number } | null = null;
  private owed: Scene | null = null; // not drawn yet
  onDrawn: (scene: Scene) => void = () => {};
  onBusy: () => void = () => {}; // it is, or is no longer
  onMoved: () => void = () => {}; // it was turned, shifted, or came nearer
  private moved = false; // by another
  follows = false; // another: how it is seen stays, whatever it grows to
  onFrame: (sight: Sight) => void = () => {};

  // `over`: what stands on the lower end of the canvas, which meshes are fitted above.
  constructor(
    private readonly canvas: HTMLCanvasElement,
    over: HTMLElement,
  ) {
    this.renderer = rendererOf(canvas);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => {
      this.redraw();
      if (!this.moved) this.onMoved();
    });
    this.controls.addEventListener("start", () => {
      this.moving = true;
      this.flight = null;
      this.stood = null;
      this.fitted = true;
      this.redraw();
    });
    this.controls.addEventListener("end", () => {
      this.moving = false;
      this.redraw();
    });
    this.camera.up.set(0, 0, 1);
    this.camera.position.copy(kAside);
    const sun = new DirectionalLight("#ffffff", 2.1);
    sun.position.set(-0.6, 1, 1.2);
    this.camera.add(sun);
    const sky = new HemisphereLight("#ffffff", "#8b93a5", 1.25);
    this.all.add(this.surface, this.rough, this.wires, this.curve.object, this.net.object);
    this.scene.add(this.camera, sky, this.all);
    const marks = [
      this.bareEdge,
      this.bare,
      this.rim,
      this.corners,
      this.chosenEdges,
      this.faultEdges,
      this.chosen,
      this.faults,
      this.pinnedEdges,
      this.pinned,
    ];
    marks.forEach((mark, i) => (mark.object.renderOrder = i + 1));
    this.all.add(...marks.map((mark) => mark.object));
    const resized = new ResizeObserver(() => {
      const hidden = canvas.getBoundingClientRect().bottom - over.getBoundingClientRect().top;
      this.below = Math.min(Math.max(hidden, 0), canvas.clientHeight / 2);
      if (!this.fitted) this.fit();
      this.redraw();
    });
    resized.observe(canvas);
    resized.observe(over);
    this.all.visible = false;
    this.setWires(true);
    requestAnimationFrame((now) => this.tick(now));
  }

  get draws(): boolean {
    return this.renderer !== null;
  }

  // What it was told is not on the screen yet, or the camera flies.
  get busy(): boolean {
    return this.dirty || this.flight !== null;
  }

  private redraw() {
    this.dirty = true;
    this.onBusy();
  }

  setBackground(colour: string) {
    this.scene.background = new Color(colour);
    this.redraw();
  }

  setWires(on: boolean) {
    this.wires.visible = on;
    this.redraw();
  }

  // Nothing, until something else is shown, from where somebody stood last.
  clear() {
    if (this.stood) this.camera.position.copy(this.controls.target).add(this.stood);
    this.stood = null;
    this.all.visible = false;
    this.fitted = false;
    this.flight = null;
    this.owed = null;
    this.redraw();
  }

  // In R^d: a plane is looked at from above, whatever was looked at before.
  standIn(d: number) {
    if (this.flat === (d === 2)) return;
    this.flat = d === 2;
    this.controls.target.set(0, 0, 0);
    this.camera.position.copy(this.flat ? kAbove : kAside);
  }

  // `plain`: of what has no colour of its own. `several`: of where walls meet, and about dots.
  // `curve`: its segments are the mesh, not edges of it.
  show(scene: Scene, plain: string, several: string, curve: boolean) {
    this.all.visible = scene.vertices > 0;
    const { shape, rim } = scene;
    const solid = shape.kind === "triangles";
    const colours = coloursOf(shape, new Color(plain));
    this.surface.geometry.dispose();
    this.surface.geometry = new BufferGeometry();
    if (solid) {
      this.surface.geometry = geometryOf(shape.positions, shape.index);
      this.surface.geometry.setAttribute("color", new BufferAttribute(colours, 3, true));
    }
    const ofCurve = (rows: ArrayLike<number>) =>
      solid ? new Float32Array(0) : pairsOf(rows, shape.index);
    const [lines, none] = curve ? [this.curve, this.net] : [this.net, this.curve];
    none.show(new Float32Array(0));
    lines.show(
      ofCurve(shape.positions),
      ofCurve(colours).map((byte) => byte / 255),
    );
    this.wires.geometry = this.surface.geometry;
    this.rough.geometry.dispose();
    this.rough.geometry = new BufferGeometry(); // until it is needed
    const colourOf = (wall: number) => (wall === kSeveral ? several : wallColour(wall));
    this.rim.show(rim.segments, Array.from(rim.walls, colourOf));
    const corners = Array.from(rim.pointWalls, (wall) => new Color(colourOf(wall)));
    this.corners.show(rim.points, bytesOf(corners));
    this.bareEdge.show(scene.bare.positions, several);
    this.bare.show(scene.bare.positions, coloursOf(scene.bare, kWhite));
    this.chosenEdges.show(scene.chosenEdges);
    this.faultEdges.show(scene.faultEdges);
    this.faults.show(scene.faults);
    this.chosen.show(scene.chosen);
    this.pinnedEdges.show(scene.pinnedEdges);
    this.pinned.show(scene.pinned);
    const stance = this.stance;
    this.ball = { centre: new Vector3(...scene.centre), radius: scene.radius };
    if (this.follows) this.stand(stance);
    if (!this.fitted && scene.vertices > 0) this.fit();
    this.owed = scene;
    this.redraw();
  }

  // All of the mesh, from where one looks now; follows it as it grows until somebody turns it.
  fit() {
    const direction = this.camera.position.clone().sub(this.controls.target).normalize();
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const narrow = height > 0 ? Math.min(height - this.below, width) / height : 1;
    const half = Math.atan(narrow * Math.tan((this.camera.fov * Math.PI) / 360));
    const distance = (1.08 * this.ball.radius) / Math.sin(half);
    this.controls.target.copy(this.ball.centre);
    this.camera.position.copy(this.ball.centre).addScaledVector(direction, distance);
    this.controls.update();
    this.flight = null;
    this.redraw();
  }

  refit() {
    this.fitted = false;
    this.fit();
  }

  // By hand: round the middle, as radians to the right and downwards.
  turn(right: number, down: number) {
    const way = this.camera.position.clone().sub(this.controls.target);
    const place = new Spherical().setFromVector3(new Vector3(way.x, way.z, -way.y));
    place.theta += right;
    place.phi += down;
    const { x, y, z } = new Vector3().setFromSpherical(place.makeSafe());
    this.moveTo(new Vector3(x, -z, y));
  }
  // To so many times the distance.
  approach(times: number) {
    this.moveTo(this.camera.position.clone().sub(this.controls.target).multiplyScalar(times));
  }
  private moveTo(way: Vector3) {
    this.flight = null;
    this.stood = null;
    this.fitted = true;
    this.camera.position.copy(this.controls.target).add(way);
    this.controls.update();
    this.redraw();
  }

  get stance(): Stance {
    const { centre, radius } = this.ball;
    const { target } = this.controls;
    return {
      eye: this.camera.position.clone().sub(target).divideScalar(radius),
      aside: target.clone().sub(centre).divideScalar(radius),
    };
  }
  // Until it is fitted again, or turned.
  stand({ eye, aside }: Stance) {
    const { centre, radius } = this.ball;
    this.moved = true;
    this.fitted = true;
    this.controls.target.copy(centre).addScaledVector(aside, radius);
    this.camera.position.copy(this.controls.target).addScaledVector(eye, radius);
    this.controls.update();
    this.moved = false;
    this.redraw();
  }

  // Through a place on the canvas, from its upper left corner.
  rayAt(x: number, y: number): Ray {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const place = new Vector2((2 * x) / width - 1, 1 - (2 * y) / height);
    const caster = new Raycaster();
    caster.setFromCamera(place, this.camera);
    const { origin, direction } = caster.ray;
    const pixel = (2 * Math.tan((this.camera.fov * Math.PI) / 360)) / height;
    return { origin: origin.toArray(), direction: direction.toArray(), pixel };
  }

  private get sight(): Sight {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const distance = this.camera.position.distanceTo(this.controls.target);
    const along = (i: number) =>
      new Vector3().setFromMatrixColumn(this.camera.matrixWorld, i).toArray();
    return {
      width,
      height,
      bottom: height - this.below,
      pixels: height / (2 * distance * Math.tan((this.camera.fov * Math.PI) / 360)),
      right: along(0),
      up: along(1),
      empty: !this.all.visible,
    };
  }

  flyTo(centre: [number, number, number], radius: number, normal: [number, number, number]) {
    const target = new Vector3(...centre);
    const distance = (2.5 * radius) / Math.tan((this.camera.fov * Math.PI) / 360);
    const sight = this.camera.position.clone().sub(target).normalize();
    this.stood ??= this.camera.position.clone().sub(this.controls.target);
    // From outside, if nothing better is found.
    const outside = target.clone().sub(this.ball.centre).normalize().addScaledVector(sight, 0.6);
    const ways = [outside.lengthSq() > 0.01 ? outside.normalize() : sight];
    const face = new Vector3(...normal).normalize();
    if (face.lengthSq() > 0) {
      if (face.dot(sight) < 0) face.negate();
      face.addScaledVector(sight, 0.3).normalize();
      ways.unshift(face, face.clone().negate());
    }
    const out = ways.find((way) => this.isFree(target, way, radius, distance)) ?? ways[0];
    this.flight = {
      from: [this.camera.position.clone(), this.controls.target.clone()],
      to: [target.clone().addScaledVector(out, distance), target],
      start: performance.now(),
    };
    this.fitted = true;
    this.onBusy();
  }

  // Whether nothing of the mesh stands between.
  private isFree(target: Vector3, way: Vector3, near: number, far: number): boolean {
    const from = target.clone().addScaledVector(way, 0.25 * near);
    const ray = new Raycaster(from, way, 0, far);
    return ray.intersectObject(this.surface, false).length === 0;
  }

  private tick(now: number) {
    requestAnimationFrame((next) => this.tick(next));
    if (this.flight) {
      const { from, to, start } = this.flight;
      const t = Math.min(Math.max((now - start) / 1000 / kFlight, 0), 1);
      const s = t * t * (3 - 2 * t);
      this.camera.position.lerpVectors(from[0], to[0], s);
      this.controls.target.lerpVectors(from[1], to[1], s);
      this.controls.update();
      if (t === 1) this.flight = null;
      this.dirty = true;
    }
    if (!this.dirty) return;
    this.dirty = false;
    this.draw();
    const scene = this.owed;
    this.owed = null;
    if (scene) this.onDrawn(scene);
    this.onBusy();
  }

  private draw() {
    const began = performance.now();
    const coarse = (this.moving || this.flight !== null) && this.slow > kSlowFrame;
    const wires = this.wires.visible;
    this.wires.visible = wires && !coarse;
    if (coarse) this.roughen();
    this.rough.visible = coarse;
    this.surface.visible = !coarse;
    const ratio = coarse ? 0.5 : Math.min(window.devicePixelRatio, 2);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const { renderer } = this;
    if (renderer === null || width === 0 || height === 0) return;
    renderer.setPixelRatio(ratio);
    renderer.setSize(width, height, false);
    this.camera.setViewOffset(width, height, 0, this.below / 2, width, height);
    const distance = this.camera.position.distanceTo(this.controls.target);
    this.camera.near = Math.max(distance - 4 * this.ball.radius, distance / 500);
    this.camera.far = distance + 20 * this.ball.radius;
    this.camera.updateProjectionMatrix();
    renderer.render(this.scene, this.camera);
    this.onFrame(this.sight);
    awaitDrawn(renderer.getContext());
    this.wires.visible = wires;
    if (!coarse) this.slow = 0.5 * this.slow + (0.5 * (performance.now() - began)) / 1000;
  }

  // Shares its vertices with the surface.
  private roughen() {
    const { attributes, index } = this.surface.geometry;
    const rough = this.rough.geometry;
    if (rough.index !== null || attributes.position === undefined) return;
    rough.setAttribute("position", attributes.position);
    rough.setAttribute("color", attributes.color);
    rough.setIndex(
      new BufferAttribute(roughIndex(attributes.position.array, index?.array ?? null), 1),
    );
  }
}

// The triangles' edges, faintly.
class LineWires extends MeshStandardMaterial {
  constructor() {
    super({ wireframe: true, color: "#0b1220", transparent: true, opacity: 0.22, roughness: 1 });
  }
}

function rendererOf(canvas: HTMLCanvasElement): WebGLRenderer | null {
  try {
    return new WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
  } catch {
    return null;
  }
}

// Until all is drawn: browsers take finish() for flush(), and frames would queue up.
function awaitDrawn(gl: WebGLRenderingContext | WebGL2RenderingContext) {
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}

function geometryOf(positions: Float32Array, index: Uint32Array | null): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(positions, 3));
  if (index) geometry.setIndex(new BufferAttribute(index, 1));
  return geometry;
}

// Of segments' ends three numbers each, one after the other.
function pairsOf(rows: ArrayLike<number>, index: Uint32Array | null): Float32Array {
  if (index === null) return Float32Array.from(rows);
  return Float32Array.from({ length: 3 * index.length }, (_, i) => {
    return rows[3 * index[Math.floor(i / 3)] + (i % 3)];
  });
}

function bytesOf(colours: Color[]): Uint8Array {
  return Uint8Array.from(colours.flatMap(({ r, g, b }) => [255 * r, 255 * g, 255 * b]));
}

function coloursOf(
  { values, palette }: Pick<Shape, "values" | "palette">,
  plain: Color,
): Uint8Array {
  const colours = new Uint8Array(3 * values.length);
  const colour = new Color();
  const of = (value: number) =>
    palette === "map"
      ? colourAt(value, colour)
      : colour.set(paletteColour(palette, value)).lerp(kWhite, palette === "wall" ? 0.12 : 0);
  values.forEach((value, i) => {
    const { r, g, b } = Number.isNaN(value) ? plain : of(value);
    colours[3 * i] = 255 * r;
    colours[3 * i + 1] = 255 * g;
    colours[3 * i + 2] = 255 * b;
  });
  return colours;
}
