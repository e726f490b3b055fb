// The mesh on the screen.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DirectionalLight,
  DoubleSide,
  HemisphereLight,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshStandardMaterial,
  PerspectiveCamera,
  Points,
  PointsMaterial,
  Scene as ThreeScene,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Scene } from "./messages";

// Viridis at a few places; between them straight.
const kMap = ["#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#fde725"].map(
  (c) => new Color(c),
);
const kSlowFrame = 0.08; // seconds: from here on, moving is drawn coarser
const kFlight = 0.6; // seconds

export function colourAt(value: number, out: Color): Color {
  const place = Math.min(Math.max(value, 0), 1) * (kMap.length - 1);
  const i = Math.min(Math.floor(place), kMap.length - 2);
  return out.lerpColors(kMap[i], kMap[i + 1], place - i);
}

export class View {
  private readonly renderer: WebGLRenderer;
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
  private readonly wires = new Mesh(
    this.surface.geometry,
    new LineWires() as unknown as MeshStandardMaterial,
  );
  private readonly segments = new LineSegments(
    new BufferGeometry(),
    new LineBasicMaterial({ vertexColors: true, transparent: true, opacity: 0.85 }),
  );
  private readonly faults = new Points(
    new BufferGeometry(),
    new PointsMaterial({ color: "#d92d20", size: 9, sizeAttenuation: false, depthTest: false }),
  );
  private readonly faultEdges = new LineSegments(
    new BufferGeometry(),
    new LineBasicMaterial({ color: "#d92d20", depthTest: false }),
  );
  private readonly chosen = new Points(
    new BufferGeometry(),
    new PointsMaterial({ color: "#ffb020", size: 14, sizeAttenuation: false, depthTest: false }),
  );
  private dirty = true;
  private moving = false;
  private slow = 0; // seconds that a frame takes, lately
  private fitted = false;
  private ball = { centre: new Vector3(), radius: 1 };
  private flight: { from: [Vector3, Vector3]; to: [Vector3, Vector3]; start: number } | null = null;
  onDrawn: () => void = () => {};
  private owed = false;

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => (this.dirty = true));
    this.controls.addEventListener("start", () => {
      this.moving = true;
      this.flight = null;
      this.fitted = true;
    });
    this.controls.addEventListener("end", () => {
      this.moving = false;
      this.dirty = true;
    });
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(1.4, -2.2, 1.3);
    const sun = new DirectionalLight("#ffffff", 2.1);
    sun.position.set(-0.6, 1, 1.2);
    this.camera.add(sun);
    const sky = new HemisphereLight("#ffffff", "#8b93a5", 1.25);
    this.scene.add(this.camera, sky, this.surface, this.wires, this.segments);
    this.scene.add(this.faultEdges, this.faults, this.chosen);
    this.faultEdges.renderOrder = 1;
    this.faults.renderOrder = 2;
    this.chosen.renderOrder = 3;
    new ResizeObserver(() => (this.dirty = true)).observe(canvas);
    this.setWires(true);
    requestAnimationFrame((now) => this.tick(now));
  }

  setBackground(colour: string) {
    this.scene.background = new Color(colour);
    this.dirty = true;
  }

  setWires(on: boolean) {
    this.wires.visible = on;
    this.dirty = true;
  }

  show(scene: Scene, plain: string) {
    const { shape } = scene;
    const solid = shape.kind === "triangles";
    const target = solid ? this.surface : this.segments;
    const other = solid ? this.segments : this.surface;
    target.geometry.dispose();
    target.geometry = geometryOf(shape.positions, shape.index);
    target.geometry.setAttribute(
      "color",
      new BufferAttribute(coloursOf(shape.values, new Color(plain)), 3, true),
    );
    other.geometry.dispose();
    other.geometry = new BufferGeometry();
    this.wires.geometry = this.surface.geometry;
    for (const [object, positions] of [
      [this.faults, scene.faults],
      [this.faultEdges, scene.faultEdges],
      [this.chosen, scene.chosen],
    ] as const) {
      object.geometry.dispose();
      object.geometry = geometryOf(positions, null);
      object.visible = positions.length > 0;
    }
    this.ball = { centre: new Vector3(...scene.centre), radius: scene.radius };
    if (!this.fitted) this.fit();
    this.dirty = true;
    this.owed = true;
  }

  // All of the mesh, from where one looks now; follows it as it grows until somebody turns it.
  fit() {
    const direction = this.camera.position.clone().sub(this.controls.target).normalize();
    const half = (this.camera.fov * Math.PI) / 360;
    const narrow = Math.min(1, this.camera.aspect);
    const distance = (1.08 * this.ball.radius) / Math.sin(half) / narrow;
    this.controls.target.copy(this.ball.centre);
    this.camera.position.copy(this.ball.centre).addScaledVector(direction, distance);
    this.controls.update();
    this.flight = null;
    this.dirty = true;
  }

  refit() {
    this.fitted = false;
    this.fit();
  }

  flyTo(centre: [number, number, number], radius: number) {
    const target = new Vector3(...centre);
    // From outside, so that the mesh does not stand before it.
    const out = target.clone().sub(this.ball.centre);
    if (out.length() < 0.05 * this.ball.radius) out.copy(this.camera.position).sub(target);
    const sight = this.camera.position.clone().sub(this.controls.target).normalize();
    out.normalize().addScaledVector(sight, 0.6).normalize();
    const distance = (5 * radius) / Math.tan((this.camera.fov * Math.PI) / 360);
    this.flight = {
      from: [this.camera.position.clone(), this.controls.target.clone()],
      to: [target.clone().addScaledVector(out, distance), target],
      start: performance.now(),
    };
    this.fitted = true;
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
    if (!this.owed) return;
    this.owed = false;
    this.onDrawn();
  }

  private draw() {
    const began = performance.now();
    const coarse = (this.moving || this.flight !== null) && this.slow > kSlowFrame;
    const wires = this.wires.visible;
    this.wires.visible = wires && !coarse;
    const ratio = coarse ? 0.5 : Math.min(window.devicePixelRatio, 2);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    const distance = this.camera.position.distanceTo(this.controls.target);
    this.camera.near = Math.max(distance - 4 * this.ball.radius, distance / 500);
    this.camera.far = distance + 20 * this.ball.radius;
    this.camera.updateProjectionMatrix();
    this.renderer.render(this.scene, this.camera);
    this.renderer.getContext().finish();
    this.wires.visible = wires;
    this.slow = 0.5 * this.slow + (0.5 * (performance.now() - began)) / 1000;
  }
}

// The triangles' edges, faintly.
class LineWires extends MeshStandardMaterial {
  constructor() {
    super({ wireframe: true, color: "#0b1220", transparent: true, opacity: 0.22, roughness: 1 });
  }
}

function geometryOf(positions: Float32Array, index: Uint32Array | null): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(positions, 3));
  if (index) geometry.setIndex(new BufferAttribute(index, 1));
  return geometry;
}

function coloursOf(values: Float32Array, plain: Color): Uint8Array {
  const colours = new Uint8Array(3 * values.length);
  const colour = new Color();
  values.forEach((value, i) => {
    const { r, g, b } = Number.isNaN(value) ? plain : colourAt(value, colour);
    colours[3 * i] = 255 * r;
    colours[3 * i + 1] = 255 * g;
    colours[3 * i + 2] = 255 * b;
  });
  return colours;
}
