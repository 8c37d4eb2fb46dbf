// Reads and writes MCAP logs with the format's own library.
//   node judge.mjs read FOLDER    prints {file: {streamed, indexed}} of all *.mcap there, each a digest or {error}
//   node judge.mjs write FOLDER   writes logs, and prints {file: digest} of what is in them
import { createHash } from "node:crypto";
import fs from "node:fs/promises";
import { createRequire } from "node:module";
import path from "node:path";

// Packages are beside the working directory's package.json, not beside this file.
const require = createRequire(path.join(process.cwd(), "package.json"));
const { McapIndexedReader, McapStreamReader, McapWriter } = require("@mcap/core");
const zstd = require("@foxglove/wasm-zstd");
const lz4js = require("lz4js");

const LARGEST_CHUNK = 64n << 20n; // above it a damaged size would exhaust the decompressors' memory for good
const limited = (decompress) => (bytes, size) => {
  if (size > LARGEST_CHUNK) throw new Error(`a chunk of ${size} bytes`);
  return new Uint8Array(decompress(bytes, Number(size)));
};
let decompressLz4;
/** After one damaged frame it refuses all that follow, until it is loaded again. */
async function loadLz4() {
  delete require.cache[require.resolve("@foxglove/wasm-lz4")];
  decompressLz4 = require("@foxglove/wasm-lz4");
  await decompressLz4.isLoaded;
}
const decompressHandlers = {
  lz4: limited((bytes, size) => decompressLz4(bytes, size)),
  zstd: limited(zstd.decompress),
};

const sha256 = (bytes) => createHash("sha256").update(bytes).digest("hex");
const wrap = (value) => BigInt.asUintN(64, value);

class Digest {
  topics = new Map();
  attachments = [];
  metadata = [];
  header = {};

  setHeader({ profile, library }) {
    this.header = { profile, library };
  }

  addMessage(message, channel, schema) {
    const topic = channel?.topic ?? "?";
    if (!this.topics.has(topic)) {
      const type = schema ? `${schema.name} ${schema.encoding} ${sha256(schema.data)}` : "";
      this.topics.set(topic, { count: 0, logTimes: 0n, type, hash: createHash("sha256") });
    }
    const entry = this.topics.get(topic);
    entry.count += 1;
    entry.logTimes = wrap(entry.logTimes + message.logTime);
    const prefix = Buffer.alloc(24);
    prefix.writeUInt32LE(message.sequence, 0);
    prefix.writeBigUInt64LE(message.logTime, 4);
    prefix.writeBigUInt64LE(message.publishTime, 12);
    prefix.writeUInt32LE(message.data.byteLength, 20);
    entry.hash.update(prefix).update(message.data);
  }

  addAttachment({ name, mediaType, logTime, createTime, data }) {
    this.attachments.push([name, mediaType, String(logTime), String(createTime), sha256(data)]);
  }

  addMetadata({ name, metadata }) {
    this.metadata.push([name, Object.fromEntries(metadata)]);
  }

  finish() {
    const topics = {};
    for (const [topic, { count, logTimes, type, hash }] of this.topics) {
      topics[topic] = { count, logTimes: String(logTimes), type, sha256: hash.digest("hex") };
    }
    return { header: this.header, topics, attachments: this.attachments, metadata: this.metadata };
  }
}

function readStreamed(bytes) {
  const digest = new Digest();
  const schemas = new Map();
  const channels = new Map();
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  reader.append(bytes);
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Header") digest.setHeader(record);
    if (record.type === "Schema") schemas.set(record.id, record);
    if (record.type === "Channel") channels.set(record.id, record);
    if (record.type === "Attachment") digest.addAttachment(record);
    if (record.type === "Metadata") digest.addMetadata(record);
    if (record.type === "Message") {
      const channel = channels.get(record.channelId);
      digest.addMessage(record, channel, schemas.get(channel?.schemaId));
    }
  }
  if (!reader.done()) throw new Error("the log is not complete");
  return digest.finish();
}

async function readIndexed(bytes) {
  const readable = {
    size: async () => BigInt(bytes.byteLength),
    read: async (offset, size) => {
      if (offset + size > BigInt(bytes.byteLength)) throw new Error(`${size} bytes at ${offset} are past the end`);
      return bytes.slice(Number(offset), Number(offset + size));
    },
  };
  const digest = new Digest();
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  digest.setHeader(reader.header);
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId);
    digest.addMessage(message, channel, reader.schemasById.get(channel?.schemaId));
  }
  for await (const attachment of reader.readAttachments({ validateCrcs: true })) digest.addAttachment(attachment);
  for await (const metadata of reader.readMetadata()) digest.addMetadata(metadata);
  return digest.finish();
}

async function orError(read) {
  try {
    return await read();
  } catch (error) {
    await loadLz4();
    return { error: String(error.message ?? error) };
  }
}

async function readAll(folder) {
  const out = {};
  for (const name of (await fs.readdir(folder)).sort()) {
    if (!name.endsWith(".mcap")) continue;
    const bytes = new Uint8Array(await fs.readFile(path.join(folder, name)));
    out[name] = {
      streamed: await orError(() => readStreamed(bytes)),
      indexed: await orError(() => readIndexed(bytes)),
    };
  }
  return out;
}

/** The same numbers on every run. */
function randomNumbers(seed) {
  let state = seed;
  return (end) => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return (state >>> 8) % end;
  };
}

async function writeOne(file, seed, options) {
  const below = randomNumbers(seed);
  const parts = [];
  let size = 0n;
  const writable = {
    position: () => size,
    write: async (bytes) => {
      parts.push(Buffer.from(bytes));
      size += BigInt(bytes.byteLength);
    },
  };
  const digest = new Digest();
  const writer = new McapWriter({ writable, ...options });
  const header = { profile: "judge", library: "test" };
  await writer.start(header);
  digest.setHeader(header);
  const schema = { name: "S", encoding: "jsonschema", data: Buffer.from("{}") };
  const schemaId = await writer.registerSchema(schema);
  const channels = [];
  for (let i = 0; i < 3; ++i) {
    const channel = {
      topic: `/t${i}`, schemaId: i === 0 ? 0 : schemaId, messageEncoding: "json", metadata: new Map([["i", `${i}`]]),
    };
    channels.push({ ...channel, id: await writer.registerChannel(channel) });
  }
  for (let i = 0; i < 150; ++i) {
    const channel = channels[below(3)];
    const data = Buffer.alloc(below(300), below(256));
    const logTime = BigInt(1000 + i * 10 - below(40));
    const message = { channelId: channel.id, sequence: i, logTime, publishTime: logTime + 1n, data };
    await writer.addMessage(message);
    digest.addMessage(message, channel, channel.schemaId === 0 ? undefined : schema);
    if (below(30) === 0) {
      const attachment = { name: "a", mediaType: "b", logTime, createTime: 0n, data };
      await writer.addAttachment(attachment);
      digest.addAttachment(attachment);
    }
    if (below(30) === 0) {
      const metadata = { name: "m", metadata: new Map([["k", `${i}`]]) };
      await writer.addMetadata(metadata);
      digest.addMetadata(metadata);
    }
  }
  await writer.end();
  await fs.writeFile(file, Buffer.concat(parts));
  return digest.finish();
}

async function writeAll(folder) {
  const compressions = {
    none: undefined,
    zstd: (bytes) => ({ compression: "zstd", compressedData: zstd.compress(bytes) }),
    lz4: (bytes) => ({ compression: "lz4", compressedData: lz4js.compress(bytes) }),
  };
  const off = (name) => ({ [name]: false });
  const variants = {
    whole: {}, loose: off("useChunks"), plain: off("useStatistics"), unindexed: off("useChunkIndex"),
    messages: off("useMessageIndex"), offsets: off("useSummaryOffsets"), channels: off("repeatChannels"),
    attachments: off("useAttachmentIndex"),
  };
  const out = {};
  let seed = 1;
  for (const [compression, compressChunk] of Object.entries(compressions)) {
    for (const [variant, options] of Object.entries(variants)) {
      const name = `${variant}_${compression}.mcap`;
      const all = { chunkSize: 4000, compressChunk, ...options };
      out[name] = await writeOne(path.join(folder, name), seed++, all);
    }
  }
  return out;
}

await Promise.all([loadLz4(), zstd.isLoaded]);
const [mode, folder] = process.argv.slice(2);
const run = { read: readAll, write: writeAll }[mode];
if (!run || !folder) throw new Error("usage: node judge.mjs read|write FOLDER");
process.stdout.write(JSON.stringify(await run(folder)));
