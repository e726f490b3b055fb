// Meshes of smooth manifolds of any dimension, known through oracles alone.
export { check, type CheckReport, chooseEpsilon, type Finding } from "./check.js";
export { Client, type ClientOptions } from "./client.js";
export type { Credentials } from "./credentials.js";
export * from "./errors.js";
export { ProductOfCircles, Torus } from "./manifolds.js";
export { checkSave, loadTxt, Mesh } from "./mesh.js";
export type { Found, Oracle } from "./oracle.js";
export { progressBar } from "./progress.js";
export { type MeshInfo, type Progress, type Report } from "./report.js";
export { findStellated, Server } from "./server.js";
export { reconstruct, type ReconstructOptions } from "./reconstruct.js";
export { type Connection, download, mesh, type RunOptions, serve, watch } from "./session.js";
export type { MeshOptions } from "./spec.js";
export type { PointOptions } from "./upload.js";
export { Worker, type WorkerOptions } from "./worker.js";
