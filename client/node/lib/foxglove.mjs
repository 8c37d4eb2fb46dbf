// What Foxglove draws of a link, and how it is told a message's schema. Units and frames as in the API.
import protoLoader from "@grpc/proto-loader";

import { PROTO } from "./taclink.mjs";

const FILES = ["taclink/v1/tactile", "foxglove/scene", "foxglove/transform"].map((name) => `${name}.proto`);
const definition = protoLoader.loadSync(FILES, { includeDirs: [PROTO], keepCase: true, longs: String });

const SKIN_COLOR = { r: 0.8, g: 0.8, b: 0.85, a: 0.8 };
const FORCE_COLOR = { r: 0.9, g: 0.2, b: 0.15, a: 1 };
const ARROW_M_PER_N = 0.05; // as in the server's logs
const HEAD_M = 0.01;

/** Bytes of a message of that full name. */
export function encode(type, message) {
  return definition[type].serialize(message);
}

function varint(value) {
  const bytes = [];
  for (let left = value; ; left >>>= 7) {
    if (left < 128) return [...bytes, left];
    bytes.push((left & 127) | 128);
  }
}

/** The FileDescriptorSet of a message, in base64. */
export function schemaOf(type) {
  const files = definition[type].fileDescriptorProtos;
  return Buffer.concat(files.flatMap((file) => [Buffer.from([10, ...varint(file.length)]), file])).toString("base64");
}

/** ns since 1970-01-01 UTC as google.protobuf.Timestamp. */
export function timestamp(utcNs) {
  const ns = BigInt(utcNs);
  return { seconds: String(ns / 1_000_000_000n), nanos: Number(ns % 1_000_000_000n) };
}

export function transformOf(link, utcNs) {
  const { translation_m: translation, rotation } = link.base_from_link;
  return {
    timestamp: timestamp(utcNs),
    parent_frame_id: "base",
    child_frame_id: `link/${link.name}`,
    translation,
    rotation,
  };
}

// Unit quaternion that turns +x into the direction of v.
function towards({ x, y, z }) {
  const length = Math.hypot(x, y, z);
  const [w, qy, qz] = [length + x, -z, y];
  const norm = Math.hypot(w, qy, qz);
  return norm < 1e-9 * length ? { x: 0, y: 0, z: 1, w: 0 } : { x: 0, y: qy / norm, z: qz / norm, w: w / norm };
}

function arrow({ center_m: center, force_n: force }) {
  const length = ARROW_M_PER_N * Math.hypot(force.x, force.y, force.z);
  const along = (axis) => center[axis] - ARROW_M_PER_N * force[axis]; // its head is on the skin
  return {
    pose: { position: { x: along("x"), y: along("y"), z: along("z") }, orientation: towards(force) },
    shaft_length: Math.max(length - HEAD_M, 0),
    shaft_diameter: 0.004,
    head_length: Math.min(HEAD_M, length),
    head_diameter: 0.008,
    color: FORCE_COLOR,
  };
}

// Two between each four markers; ring by ring, closed around.
function triangles({ paths, rings }) {
  const indices = [];
  for (let ring = 0; ring + 1 < rings; ++ring) {
    for (let path = 0; path < paths; ++path) {
      const a = ring * paths + path;
      const b = ring * paths + ((path + 1) % paths);
      indices.push(a, b, a + paths, b, b + paths, a + paths);
    }
  }
  return indices;
}

/** A frame at GEOMETRY as foxglove.SceneUpdate; grid: the model's {paths, rings}. */
export function sceneOf(frame, grid) {
  const points = [];
  const { positions_m: p } = frame;
  for (let i = 0; i + 2 < p.length; i += 3) points.push({ x: p[i], y: p[i + 1], z: p[i + 2] });
  const skin = points.length === grid.paths * grid.rings ? [{ points, color: SKIN_COLOR, indices: triangles(grid) }] : [];
  return {
    entities: [
      {
        timestamp: timestamp(frame.times.exposure_utc_ns),
        frame_id: `link/${frame.link}`,
        id: frame.link,
        arrows: frame.contacts.map(arrow),
        triangles: skin,
      },
    ],
  };
}
